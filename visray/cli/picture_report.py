"""The report of a rendered picture. Facts are the metadata of an Image: how it was made, and how large its error is."""

from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from visray.output.image import Image

# The facts that --json reports: for every picture, for pictures with --error or --time, and for pictures of polynomial
# surfaces or tori.
FACTS = (
    "spp", "seed", "precision", "backend", "features", "scene_hash", "render_seconds", "threads", "error_at_most",
    "depth_error_at_least",
)  # fmt: skip
ADAPTIVE_FACTS = (
    "sampler", "spp_least", "spp_most", "error", "error_low", "error_high", "depth_error", "file_error", "error_asked",
    "time_asked", "time_missed", "unseen_error", "unseen", "small_object_pixels", "forecast_error", "forecast_spp",
    "forecast_seconds",
)  # fmt: skip
# Rounding of single precision. The samples of a pixel that differ by less have the same colour.
SINGLE = 1e-6
CERTIFICATE_FACTS = ("unresolved", "residual_ulps")


def report(image: "Image", outputs: list[Path], seconds: float) -> dict[str, Any]:
    """The report for --json, as a dict.

    outputs: paths of the files written. seconds: duration of the render.
    """
    facts = image.metadata
    return (
        {"outputs": [str(path) for path in outputs], "width": image.width, "height": image.height}
        | {key: facts[key] for key in (*FACTS, *CERTIFICATE_FACTS, *ADAPTIVE_FACTS) if key in facts}
        | {"layers": list(image.layers), "seconds": seconds, "stopped": bool(facts["interrupted"])}
    )


def line(image: "Image", outputs: list[Path], seconds: float, found: float | None) -> str:
    """The report as one line of text: files, size, time, error, samples.

    outputs: paths of the files written, or the name of a picture that is only shown. seconds: duration of the render.
    found: samples per pixel of the checkpoint with which the render went on, or None.
    """
    facts = image.metadata
    names = ", ".join(str(path) for path in outputs)
    begun = "" if found is None else f" ({found:.3g} of them from the checkpoint)"
    stopped = ", stopped" if facts["interrupted"] else ""
    parts = (
        f"{image.width} x {image.height} pixels in {seconds:.1f} s{stopped}",
        _error(facts),
        _samples(facts) + begun,
    )
    return f"{names}: {', '.join(filter(None, parts))}"


def goal_met(facts: dict[str, Any]) -> bool:
    """Whether the error is as small as the user asked for. True if no error was asked for."""
    return facts.get("error_high", 0.0) <= facts.get("error_asked", inf)


def _samples(facts: dict[str, Any]) -> str:
    """The samples per pixel in words."""
    spp, asked = facts["spp"], ""
    if "error" not in facts and facts["interrupted"]:
        asked = f" of {facts['spp_asked']:,}"
    mean = f"{spp:,.0f}" if spp >= 100 else f"{spp:.3g}"
    least, most = facts.get("spp_least", spp), facts.get("spp_most", spp)
    between = "" if least == most else f" ({least:,} to {most:,})"
    return f"{mean}{asked} sample{'s' * (spp != 1 or bool(asked))} per pixel{between}"


def _error(facts: dict[str, Any]) -> str:
    """The error in words; "" if it is not known."""
    if "error" not in facts:
        # The bound is the error of independent samples. Other samplers have a smaller error; how much is not known.
        if "error_at_most" not in facts:
            return ""
        most, bound = facts["error_at_most"], "" if facts["sampler"] == "independent" else "below "
        if most >= 1:
            return "error unknown: too few samples"
        noise = "no noise seen" if most < SINGLE else f"error {bound}{_percent(most)} %"
        depth = facts.get("depth_error_at_least", 0.0)
        # The squares of errors add up. So one of a fifth of the other changes the error by about 2 %, as below.
        if depth <= max(0.2 * most, SINGLE):
            return noise
        least = f"at least {_percent(depth)} % by settings.depth"
        return f"error {least}" if most < SINGLE else f"{noise} by noise, {least}"
    if not facts["error_high"]:
        return "no noise"
    middle, low, high = (_percent(facts[f"error{end}"], 3) for end in ("", "_low", "_high"))
    parts = {"depth": facts["depth_error"], "the file's rounding": facts["file_error"]}
    # The squares of errors add up. So a part below a fifth of the whole error changes it by about 2 % and is not shown.
    largest = "".join(f"; {name} alone: {_percent(x)} %" for name, x in parts.items() if x > 0.2 * facts["error"])
    # The upper end of the interval is the root of a sum of squares, too.
    if facts.get("unseen_error", 0.0) > 0.2 * facts["error_high"]:
        largest += f"; if no sample met {facts['unseen']}: {_percent(facts['unseen_error'])} %"
    above = "" if goal_met(facts) else f", above the {_percent(facts['error_asked'])} % asked"
    return f"error {middle} % ({low} to {high} %{largest}){above}"


def _percent(share: float, digits: int = 2) -> str:
    """A share in percent, without the sign."""
    return f"{100 * share:.{digits}g}" if share < 1 else f"{100 * share:,.0f}"
