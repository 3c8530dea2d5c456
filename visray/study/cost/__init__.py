"""The cost of accuracy: error and time with every setting that trades one for the other, and the choice of settings for
a target.

Words of this package:

    setting   what a study varies. It has a name, such as "sky rays" or "samples, sobol". It is one field of the scene,
              or a few that change together: "samples, sobol" is settings.spp and settings.sampler
    settings  of a choice or a record: values of fields of the scene, by address, which need not lie in the section
              `settings` of a scene file. That section is scene.settings in the code
    choice    one value of a setting. All other settings are as in the scene
    turn      pictures of all choices, one after the other. A study has several turns

Records (records.py) are plain data. A study makes one `Record` for each choice, a `Curve` of records for each setting,
a `Price` for what an error costs with a setting, and a `Report` with all of them.

    choices.py     settings of a scene that a study varies, and their choices
    measuring.py   pictures of many seeds for each choice, in turns, and kernel seconds
    on_workers.py  turns on the workers of a cluster
    truth.py       the reference, and errors that samples do not reduce
    errors.py      error, bias and noise with intervals (jackknife over seeds), MRSE, FLIP
    slopes.py      slopes of errors with intervals
    hits.py        first hits and self-shadows against the reference
    comparing.py   frontier, prices, savings, and the best values of all settings together
    study.py       the study: `vr.cost`
    writing.py     how reports write numbers, durations and settings
    advice.py      what a report says in sentences: what to do, and why
    report.py      JSON, CSV and the table of a report
    charts.py      figures as SVG and PNG
    page.py        the HTML page
    tuned.py       records of `tune`
    tuning.py      the choice of settings for an error or a time: `vr.tune`

There is no model of all settings together. Choices come from measured curves; what several settings do together is
measured again (`Report.joint`); `tune` leaves samples per pixel to the adaptive sampler, and compares renders at full
size.
"""
