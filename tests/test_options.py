"""Options are checked in one place, and what is wrong is said with name, value and range."""

from __future__ import annotations

import copy
import inspect
import pickle

import numpy as np
import pytest

import coarsen
from coarsen.options import BACKENDS, CANDIDATES, FEATURES, METHODS, SPACINGS, Options


@pytest.mark.parametrize(
    ("name", "value", "range_said"),
    [
        ("factor", 1.0, "> 1"),
        ("factor", np.inf, "> 1"),
        ("factor", np.nan, "> 1"),
        ("factor", "2", "> 1"),
        ("factor", True, "> 1"),
        ("factor", None, "> 1"),
        ("factor", 2 + 0j, "> 1"),
        ("levels", -1, ">= 0"),
        ("levels", 1.5, ">= 0"),
        ("levels", np.nan, ">= 0"),
        ("levels", np.inf, ">= 0"),
        ("levels", "3", ">= 0"),
        ("coarsest", 0, ">= 1"),
        ("coarsest", None, ">= 1"),
        ("nested", 1, "True or False"),
        ("nested", "yes", "True or False"),
        ("method", "functions", "'threshold'"),
        ("method", 3, "'mis'"),
        ("spacing", "neares", "did you mean 'nearest'?"),
        ("spacing", 3.0, "callable"),
        ("spacing", None, "callable"),
        ("spacing", [[1.0, 2.0]], "callable"),
        ("spacing", ["a"], "callable"),
        ("beta", 1, "> 1"),
        ("delta", -0.1, ">= 0"),
        ("gradation", 0.0, "(0, 1]"),
        ("gradation", 1.0001, "(0, 1]"),
        ("features", "Keep", "did you mean 'keep'?"),
        ("candidates", "pools", "did you mean 'pool'?"),
        ("min_angle", 60.0, "[0, 60)"),
        ("min_angle", -0.1, "[0, 60)"),
        ("feature_angle", 0.0, "(0, 180]"),
        ("feature_angle", 181, "(0, 180]"),
        ("backend", "cuda", "'numpy'"),
        ("threads", 0, ">= 1"),
        ("threads", 2.5, ">= 1"),
    ],
)
def test_options_out_of_range_are_named_with_value_and_range(name, value, range_said):
    with pytest.raises(ValueError, match=f"'{name}' is ") as caught:
        Options.from_kwargs(**{name: value})
    assert range_said in str(caught.value)
    assert repr(value)[:10] in str(caught.value)


def test_the_ends_of_the_ranges_belong_to_them():
    options = Options(
        gradation=1, delta=0, feature_angle=180, levels=0, coarsest=1, threads=1, min_angle=np.float32(20)
    )
    assert (options.gradation, options.delta, options.levels, options.min_angle) == (1.0, 0.0, 0, 20.0)
    assert isinstance(Options(levels=np.int64(3), coarsest=10.0).coarsest, int)


def test_every_choice_is_taken():
    for name, choices in (
        ("method", METHODS),
        ("spacing", SPACINGS),
        ("features", FEATURES),
        ("candidates", CANDIDATES),
        ("backend", BACKENDS),
    ):
        for choice in choices:
            assert getattr(Options(**{name: choice}), name) == choice
        assert getattr(Options(), name) in choices


@pytest.mark.parametrize(
    ("name", "hint"), [("factr", "factor"), ("min_angel", "min_angle"), ("Features", "features"), ("thread", "threads")]
)
def test_an_unknown_option_is_named_with_the_nearest(name, hint):
    with pytest.raises(ValueError, match=f"unknown option '{name}': did you mean '{hint}'"):
        Options.from_kwargs(**{name: 1})
    with pytest.raises(ValueError, match="did you mean"):
        coarsen.hierarchy(coarsen.gallery.square(100), **{name: 1})


def test_an_option_like_none_is_answered_with_all():
    with pytest.raises(ValueError, match="the options are factor, levels, "):
        Options.from_kwargs(xyzzy=1)


def test_a_given_spacing_is_the_options_own():
    given = np.ones(4)
    options = Options(spacing=given)
    given[0] = 5.0
    assert options.spacing.tolist() == [1.0] * 4
    with pytest.raises(ValueError, match="read-only"):
        options.spacing[0] = 2.0
    assert options == Options(spacing=[1, 1, 1, 1]) != Options(spacing=[1, 1, 1, 2])
    assert options != Options()
    assert pickle.loads(pickle.dumps(options)) == options == copy.deepcopy(options)


def test_functions_have_the_defaults_of_the_options():
    for function in (coarsen.coarsen, coarsen.hierarchy):
        for name, parameter in inspect.signature(function).parameters.items():
            if name in Options.__dataclass_fields__:
                assert parameter.default == getattr(Options(), name), (function, name)


def test_every_option_says_what_it_is():
    for option in Options.__dataclass_fields__.values():
        assert option.metadata["help"]
        assert f"{option.name} : " in Options.__doc__
