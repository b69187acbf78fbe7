# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Results, scenarios and encounters drawn with matplotlib."""

import numpy as np
from PIL import Image
import pytest
from support.bag_examples import hand_made_run

from scenario_gen import InputError, MissingExtraError, plot

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")


def lines(axes):
    return [line for line in axes.get_lines() if len(line.get_xdata()) > 1]


def test_each_vehicle_is_drawn_in_colour():
    made = hand_made_run()
    axes = made.plot()
    drawn = lines(axes)
    assert len(drawn) == 10 and len({line.get_color() for line in drawn}) == 2
    assert np.array_equal(np.transpose(drawn[0].get_data()), made[0].position[0])
    assert list(axes.get_images()[0].get_extent()) == pytest.approx([-10.0, 50.0, -5.0, 5.0])
    assert axes.get_title() == "5 scenarios, made by hand on straight"
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        "vehicle 1",
        "vehicle bus 2",
    ]


def test_scenario_is_drawn_on_given_axes():
    made = hand_made_run()
    own = matplotlib.figure.Figure().add_subplot()
    assert made[3].plot(own) is own and len(lines(own)) == 2 and not own.get_images()
    assert plot(made.encounter, road=made.road).get_title() == "encounter made by hand"


def test_without_matplotlib_the_extra_is_named(monkeypatch):
    monkeypatch.setattr("scenario_gen.base.errors.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"scenario_gen\[plot\]"):
        hand_made_run().plot()


def test_scenario_becomes_an_animation(tmp_path):
    made = hand_made_run()
    with Image.open(made.animate(tmp_path / "film.gif", 3)) as film:
        assert film.n_frames * film.info["duration"] / 1000 == pytest.approx(
            made[3].duration, abs=0.2
        )
        first = np.array(film.convert("RGB"))
        film.seek(film.n_frames - 1)
        assert (first != np.array(film.convert("RGB"))).any()
    with pytest.raises(InputError, match=r"\.gif"):
        made.animate(tmp_path / "film.mov")
