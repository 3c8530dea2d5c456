"""The report of `visray doctor`."""

import json
import warnings

import numpy as np
import pytest
from rich.console import Console

from visray import llvm
from visray.cli.studies import _probe
from visray.errors import UserError
from visray.study import doctor

PICTURE = np.linspace(0, 1, 32 * 32 * 3).reshape(32, 32, 3)


def failing(error: BaseException):
    def render() -> np.ndarray:
        raise error

    return render


def test_the_report_is_json_and_names_everything() -> None:
    report = json.loads(json.dumps(doctor.examine(lambda: PICTURE)))
    assert report["verdict"] == doctor.GOOD
    assert {"platform", "Python", "visray", "Dr.Jit", "Mitsuba", "NumPy", "OpenEXR", "threads"} <= set(report)
    assert report["Dr.Jit"].count(".") == 2
    assert report["LLVM"]["path"] == llvm.library().path
    assert int(report["LLVM"]["version"].split(".")[0]) >= llvm.OLDEST
    assert report["LLVM"]["vector width"] in (4, 8, 16)
    assert "llvm" in report["backends"]
    assert report["threads"] >= 1


@pytest.mark.parametrize(
    ("render", "part"),
    [
        (lambda: np.full((32, 32, 3), 0.5), "0.5 everywhere"),
        (lambda: PICTURE * np.where(PICTURE[3, 4, 1] == PICTURE, np.nan, 1), "1 pixels that are not finite"),
        (lambda: PICTURE / 0.0, "not finite"),
        (lambda: PICTURE[:16], "(16, 32, 3)"),
        (failing(UserError("scene: what is wrong", "a second line")), "scene: what is wrong"),
        (failing(RuntimeError("drjit: something\nmore")), "drjit: something"),
        (failing(RuntimeError()), "RuntimeError()"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_a_bad_picture_is_a_verdict_of_one_line(render, part: str) -> None:
    verdict = doctor.examine(render)["verdict"]
    assert part in verdict
    assert "\n" not in verdict
    assert "second" not in verdict and "more" not in verdict


def test_nothing_is_said_of_the_test_picture() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert doctor.judge(_probe) == doctor.GOOD


def test_other_errors_are_not_hidden() -> None:
    with pytest.raises(KeyError):
        doctor.examine(failing(KeyError("a bug")))


def test_without_llvm_nothing_is_rendered(monkeypatch) -> None:
    def require() -> llvm.LLVM:
        raise UserError("LLVM: there is none; install it")

    monkeypatch.setattr(llvm, "require", require)
    report = json.loads(json.dumps(doctor.examine(failing(AssertionError("rendered")))))
    assert report["verdict"] == "LLVM: there is none; install it"
    assert report["LLVM"]["path"] is None


def test_the_kernel_cache_is_measured(monkeypatch, tmp_path) -> None:
    (tmp_path / "a.bin").write_bytes(bytes(2**20))
    (tmp_path / "b.bin").write_bytes(bytes(2**19))
    (tmp_path / "notes.txt").write_bytes(bytes(2**20))
    monkeypatch.setenv("DRJIT_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("DRJIT_CACHE_MAXSIZE", "2G")
    assert doctor.kernel_cache() == {"folder": str(tmp_path), "files": 2, "MiB": 1.5, "limit": "2G"}
    monkeypatch.setenv("DRJIT_CACHE_DIR", str(tmp_path / "none"))
    monkeypatch.setenv("DRJIT_CACHE_MAXSIZE", "0")
    assert doctor.kernel_cache() == {"folder": str(tmp_path / "none"), "files": 0, "MiB": 0.0, "limit": "none"}
    monkeypatch.delenv("DRJIT_CACHE_MAXSIZE")
    assert doctor.kernel_cache()["limit"] == "1G"


def test_the_table_has_every_value() -> None:
    report = doctor.examine(lambda: PICTURE)
    console = Console(width=300, record=True, file=None, quiet=False)
    with console.capture() as capture:
        console.print(doctor.table(report))
    text = capture.get()
    for value in (report["platform"], report["LLVM"]["path"], report["kernel cache"]["folder"], "ready"):
        assert str(value) in text
