"""The quick suite, `pytest -m "not slow"`, leaves out no part of visray and no kind."""

import pytest

from visray import lights, primitives


def test_every_file_of_tests_has_one_that_is_quick(quick):
    assert not [name for name, tests in quick.items() if not tests]


@pytest.mark.parametrize("kind", [*primitives.KINDS, *lights.KINDS], ids=lambda k: k.__name__)
def test_every_kind_has_a_quick_test(kind, quick):
    """A test that has the kind, or its name, as a parameter; this one does not count."""
    if len(quick) == 1:
        pytest.skip("this file is run alone: there are no other tests to be judged")
    tests = [test for name, tests in quick.items() if name != "test_suite.py" for test in tests]
    values = [value for test in tests if hasattr(test, "callspec") for value in test.callspec.params.values()]
    assert kind.__name__ in {v.__name__ if isinstance(v, type) else v for v in values if isinstance(v, type | str)}
