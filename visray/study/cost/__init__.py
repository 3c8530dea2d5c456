"""The cost of accuracy: error and time of every knob of a scene, and the choice of knobs for a target.

Records (records.py) are plain data. A study makes one `Record` for each choice of the knobs, a `Curve` of records for
each knob, a `Price` for what an error costs with a knob, and a `Report` with all of them.

    knobs.py       knobs of a scene, and their values
    measuring.py   pictures of many seeds for each choice, in turns, and kernel seconds
    on_workers.py  turns on the workers of a cluster
    truth.py       the reference, and errors that samples do not reduce
    errors.py      error, bias and noise with intervals (jackknife over seeds), MRSE, FLIP
    slopes.py      slopes of errors with intervals
    hits.py        first hits and self-shadows against the reference
    comparing.py   frontier, prices, savings, and the best values of all knobs together
    study.py       the study: `vr.cost`
    writing.py     how reports write numbers, durations and settings
    advice.py      what a report says in sentences: what to do, and why
    report.py      JSON, CSV and the table of a report
    charts.py      figures as SVG and PNG
    page.py        the HTML page
    tuned.py       records of `tune`
    tuning.py      the choice of knobs for an error or a time: `vr.tune`

There is no model of all knobs together. Choices come from measured curves; what several knobs do together is measured
again (`Report.joint`); `tune` leaves samples per pixel to the adaptive sampler, and compares renders at full size.
"""
