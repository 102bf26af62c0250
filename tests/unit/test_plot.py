"""Pictures from a run folder that is made by hand: what is drawn, of which frames, how large, which units."""

import errno
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba

from warpsph.errors import CaseError, OutputError
from warpsph.files.output import RunFolder
from warpsph.snapshot import FLUID, WALL, Snapshot
from warpsph.study import plot
from warpsph.study.segments import read_segments

SPACING = 0.1
PNG = b"\x89PNG\r\n\x1a\n"


def lattice(dimension: int, time: float) -> Snapshot:
    """Fluid in the unit square or cube, pressure = x + time, velocity = (3, 4, ...), bottom layer as wall."""
    axis = np.arange(SPACING / 2, 1, SPACING)
    position = np.stack(np.meshgrid(*[axis] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
    n = len(position)
    wall = position[:, 1] < SPACING
    velocity = np.zeros((n, dimension))
    velocity[:, :2] = 3.0, 4.0
    return Snapshot(
        time=time,
        step=int(10 * time),
        dt=0.1,
        dimension=dimension,
        position=position,
        velocity=velocity,
        density=np.full(n, 1000.0),
        pressure=position[:, 0] + time,
        mass=np.full(n, 1000.0 * SPACING**dimension),
        volume=np.full(n, SPACING**dimension),
        phase=np.where(wall, -1, (position[:, 0] > 0.5).astype(int)).astype(np.int32),
        particle_id=np.arange(n),
        kind=np.where(wall, WALL, FLUID).astype(np.uint8),
        particle_spacing=SPACING,
    )


def make_run(path, dimension=2, times=(0.0, 0.5, 1.0, 1.5, 2.0)):
    case = "phases: {gas: {density: 1}, liquid: {density: 1000}}\n"
    fields = ("velocity", "pressure", "phase", "density", "mass")
    with RunFolder(path, case_text=case, fields=fields) as folder:
        for time in times:
            folder.write_particles(lattice(dimension, time))
    rows = "0.0,1.0,2.0\n0.5,0.5,2.0\n"
    (path / "gauges" / "energy.csv").write_text("time [s],kinetic [J/m],total [J/m]\n" + rows)
    (path / "gauges" / "size.csv").write_text("time [s],highest_x gas [m],area gas [m^2]\n0.0,1.0,2.0\n")
    rows = "".join(f"{t},{x / 20},0.5,{x + 100 * t}\n" for t in (0, 1) for x in range(21))
    (path / "gauges" / "profile.csv").write_text("time [s],x [m],y [m],pressure [Pa]\n" + rows)
    rows = "".join(f"{t},{x},0.5,{x + 100 * t}\n" for t in (0, 1, 2) for x in (0.25, 0.75))
    (path / "gauges" / "probe.csv").write_text("time [s],x [m],y [m],pressure [Pa]\n" + rows)
    (path / "gauges" / "empty.csv").write_text("time [s],kinetic [J/m]\n")
    return path


@pytest.fixture
def drawn(monkeypatch):
    """The figures that a plot would save, in order; the slow writing is tested apart."""
    figures = []

    def keep(figure, path):
        figures.append(figure)
        return path

    monkeypatch.setattr(plot, "_save", keep)
    return figures


def panels(figure):
    return [axes for axes in figure.axes if axes.get_title()]


def discs(axes):
    """Walls (if any) and fluid of a panel."""
    return axes.collections


def test_default_draws_first_middle_and_last_frame_and_the_gauges(tmp_path, drawn):
    run = make_run(tmp_path / "run")
    paths = plot.plot_run(run)
    assert paths == [run / "plots" / "pressure.png", run / "plots" / "gauges.png"]
    assert [axes.get_title() for axes in panels(drawn[0])] == ["t = 0 s", "t = 1 s", "t = 2 s"]


def test_particles_have_the_size_of_the_spacing_and_walls_are_grey(tmp_path, drawn):
    plot.plot_run(make_run(tmp_path / "run"), times=[0.6])
    (axes,) = panels(drawn[0])
    wall, fluid = discs(axes)
    # in the units of the axes, and as large as a particle
    assert np.pi / 4 * fluid.get_widths() ** 2 == pytest.approx([SPACING**2]) and fluid._units == "xy"
    assert axes.get_aspect() == 1
    assert len(wall.get_offsets()) == 10 and len(fluid.get_offsets()) == 90
    assert wall.get_array() is None and len(set(wall.get_facecolor()[0][:3])) == 1
    # the frame nearest to 0.6 s is that of 0.5 s
    np.testing.assert_allclose(fluid.get_array(), fluid.get_offsets()[:, 0] + 0.5, rtol=1e-6)
    assert fluid.get_offsets()[:, 1].min() > SPACING


@pytest.mark.parametrize(
    ("field", "value", "label"),
    [
        ("velocity", 5.0, "speed [m/s]"),
        ("speed", 5.0, "speed [m/s]"),
        ("velocity_y", 4.0, "velocity y [m/s]"),
        ("density", 1000.0, "density [kg/m^3]"),
        ("mass", 10.0, "mass [kg/m]"),
    ],
)
def test_fields_components_magnitudes_and_units(tmp_path, drawn, field, value, label):
    plot.plot_run(make_run(tmp_path / "run", times=[0.0]), field=field)
    fluid = discs(panels(drawn[0])[0])[-1]
    np.testing.assert_allclose(fluid.get_array(), value, rtol=1e-6)
    assert label in [axes.get_ylabel() for axes in drawn[0].axes]


def test_phases_have_their_names(tmp_path, drawn):
    plot.plot_run(make_run(tmp_path / "run", times=[0.0]), field="phase")
    bar = drawn[0].axes[-1]
    assert [text.get_text() for text in bar.get_yticklabels()] == ["gas", "liquid"]
    fluid = discs(panels(drawn[0])[0])[-1]
    colours = fluid.to_rgba(fluid.get_array())
    assert len(np.unique(colours, axis=0)) == 2


def three_phases(path):
    """Three phases with names of a user, one above the other; the lightest has by far the highest pressure."""
    state = lattice(2, 0.0)
    phase = np.where(state.kind == WALL, -1, np.minimum(3 * state.position[:, 1], 2).astype(int)).astype(np.int32)
    state = replace(state, phase=phase, pressure=np.where(phase == 2, 1e6, state.pressure))
    case = "phases: {salt_water_from_the_sea: {density: 1000}, oil: {density: 800}, hot air: {density: 1}}\n"
    with RunFolder(path, case_text=case, fields=("velocity", "pressure", "phase")) as folder:
        folder.write_particles(state)
    return path


def test_three_phases_with_names_of_their_own_have_a_legend(tmp_path, drawn):
    plot.plot_run(three_phases(tmp_path / "run"), field="phase")
    (figure,) = drawn
    bar = figure.axes[-1]
    labels = bar.get_yticklabels()
    assert [text.get_text() for text in labels] == ["salt_water_from_the_sea", "oil", "hot air"]
    fluid = discs(panels(figure)[0])[-1]
    assert len(np.unique(fluid.to_rgba(fluid.get_array()), axis=0)) == 3
    FigureCanvasAgg(figure).draw()  # arranges the parts
    boxes = [text.get_window_extent() for text in labels]
    assert all(box.x1 <= figure.bbox.x1 for box in boxes)
    assert all(below.y1 < above.y0 for below, above in zip(boxes, boxes[1:], strict=False))
    # a legend, no scale as high as the picture
    assert bar.get_window_extent().height < 0.45 * figure.bbox.height


def test_phases_that_are_left_out_leave_the_colour_scale_too(tmp_path, drawn):
    run = three_phases(tmp_path / "run")
    plot.plot_run(run, field="pressure", phases=["oil", "salt_water_from_the_sea"])
    wall, fluid = discs(panels(drawn[0])[0])
    assert len(fluid.get_offsets()) == 60 and fluid.get_array().max() < 1.0  # three and three of nine rows; one is wall
    assert fluid.norm.vmax < 2.0
    plot.plot_run(run, field="phase", phases=["hot air"])
    bar = drawn[1].axes[-1]
    assert [text.get_text() for text in bar.get_yticklabels()] == ["hot air"]
    with pytest.raises(CaseError, match="phases: air -> is no phase of this run; choose from: salt_water.*, oil, hot air"):
        plot.plot_run(run, phases=["oil", "air"])
    unknown = tmp_path / "unknown"
    with RunFolder(unknown, case_text="phases: {oil: {density: 1}}\n", fields=("pressure",)) as folder:
        folder.write_particles(lattice(2, 0.0))
    with pytest.raises(CaseError, match="phases.*hold no phase; run again with phase in output.particles.fields"):
        plot.plot_run(unknown, phases=["oil"])


@pytest.mark.parametrize(("axis", "drawn_axes"), [(None, (0, 1)), ("y", (0, 2)), ("x", (1, 2))])
def test_three_dimensions_show_a_slice(tmp_path, drawn, axis, drawn_axes):
    plot.plot_run(make_run(tmp_path / "run", dimension=3, times=[0.0]), field="mass", slice_axis=axis)
    (panel,) = panels(drawn[0])
    assert [panel.get_xlabel(), panel.get_ylabel()] == [f"{'xyz'[k]} [m]" for k in drawn_axes]
    picture = np.asarray(panel.get_images()[0].get_array())
    per_square_metre = picture.shape[0] * picture.shape[1] / 1.1**2  # half a spacing of margin on each side
    grey = (picture[:, :, :3] == round(0.75 * 255)).all(axis=2)
    assert grey.sum() / per_square_metre == pytest.approx(0.0 if axis == "y" else 0.1, abs=0.02)
    # Between two layers of the lattice its outer sides are a little wavy, 0.15 spacings inside of half a spacing at most.
    assert 0.94 < (picture[:, :, 3] > 0).sum() / per_square_metre < 1.01
    assert "mass [kg]" in [axes.get_ylabel() for axes in drawn[0].axes]


def test_a_slice_shows_the_holes_there_are_and_no_others():
    """Of a disordered fluid with a ball of 0.25 m left out; in a layer one spacing thick it had hundreds of holes."""
    spacing = 0.05
    axis = np.arange(spacing / 2, 1, spacing)
    position = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    position += np.random.default_rng(1).uniform(-0.5 * spacing, 0.5 * spacing, position.shape)
    position = position[np.linalg.norm(position - 0.5, axis=1) > 0.25]
    n = len(position)
    fluid = replace(lattice(3, 0.0), position=position, velocity=position, particle_spacing=spacing)
    fluid = replace(fluid, **{name: np.zeros(n) for name in ("density", "pressure", "mass", "volume", "phase")})
    fluid = replace(fluid, particle_id=np.arange(n), kind=np.full(n, FLUID, np.uint8))
    view = plot.view_of(np.zeros(3), np.ones(3), spacing, "y")
    owner = plot.slice_owner(view, view.cut(plot.Frame(0.0, fluid, None)), (440, 440))
    middle = (np.arange(440) + 0.5) / 400 - 0.05
    radius = np.hypot(middle[:, None] - 0.5, middle[None] - 0.5)
    inner = (np.abs(middle - 0.5) < 0.4)[:, None] & (np.abs(middle - 0.5) < 0.4)
    assert (owner[inner & (radius > 0.29)] >= 0).all()
    assert (owner[radius < 0.21] == -1).all()
    area = (owner >= 0).sum() / 400**2
    assert area == pytest.approx(1.0 - np.pi * 0.25**2, rel=0.03)
    # nearest in space: no particle is nearer to the middle of a pixel than its owner
    row, column = np.nonzero(owner >= 0)
    for k in range(0, len(row), 5000):
        place = np.array([middle[column[k]], 0.5, middle[row[k]]])
        cut = view.cut(plot.Frame(0.0, fluid, None)).fluid.position
        least = np.linalg.norm(cut - place, axis=1).min()
        assert np.linalg.norm(cut[owner[row[k], column[k]]] - place) == pytest.approx(least, rel=1e-3)


def test_a_runaway_particle_does_not_stretch_the_colours():
    values = np.append(np.linspace(1.0, 2.0, 1000), 1e9)
    _, norm, extend = plot._colour_scale(values)
    assert norm.vmax < 2.1 and norm.vmin == pytest.approx(1.0) and extend == "max"


@pytest.mark.parametrize("values", [np.full(5, 3.0), np.zeros(5), np.full(5, np.nan), np.zeros(0)])
def test_a_field_without_range_still_gets_a_scale(values):
    _, norm, _ = plot._colour_scale(values)
    assert norm.vmin < norm.vmax


def test_non_finite_positions_are_drawn_around(tmp_path):
    run = tmp_path / "run"
    broken = lattice(2, 0.0)
    broken.position[-1] = np.nan
    broken.pressure[-1] = np.inf
    with RunFolder(run) as folder:
        folder.write_particles(broken)
    assert plot.plot_run(run)[0].read_bytes().startswith(PNG)


def test_gauges_have_a_panel_for_each_unit(tmp_path, drawn):
    plot.plot_run(make_run(tmp_path / "run", times=[0.0]))
    shown = {(axes.get_title(), axes.get_ylabel()): axes for axes in panels(drawn[1])}
    assert set(shown) == {
        ("energy", "[J/m]"),
        ("size", "[m]"),
        ("size", "[m^2]"),
        ("profile", "pressure [Pa]"),
        ("probe", "pressure [Pa]"),
    }
    energy = shown["energy", "[J/m]"]
    assert [line.get_label() for line in energy.lines] == ["kinetic", "total"]
    np.testing.assert_array_equal(energy.lines[0].get_xydata(), [[0.0, 1.0], [0.5, 0.5]])


def test_lines_are_drawn_along_and_points_over_time(tmp_path, drawn):
    plot.plot_run(make_run(tmp_path / "run", times=[0.0]))
    shown = {axes.get_title(): axes for axes in panels(drawn[1])}
    profile, probe = shown["profile"], shown["probe"]
    assert profile.get_xlabel() == "distance along the line [m]"
    assert [line.get_label() for line in profile.lines] == ["t = 0 s", "t = 1 s"]
    np.testing.assert_allclose(profile.lines[1].get_xdata(), np.arange(21) / 20)
    np.testing.assert_allclose(profile.lines[1].get_ydata(), np.arange(21) + 100)
    assert probe.get_xlabel() == "t [s]"
    assert [line.get_label() for line in probe.lines] == ["(0.25, 0.5)", "(0.75, 0.5)"]
    np.testing.assert_allclose(probe.lines[1].get_xydata(), [[0, 0.75], [1, 100.75], [2, 200.75]])


def test_output_names_both_pictures(tmp_path):
    run = make_run(tmp_path / "run", times=[0.0])
    paths = plot.plot_run(run, output=tmp_path / "new" / "look.png")
    assert paths == [tmp_path / "new" / "look.png", tmp_path / "new" / "look_gauges.png"]
    assert all(path.read_bytes().startswith(PNG) for path in paths)


def test_a_picture_without_an_ending_is_a_png(tmp_path):
    """The path that is returned is that of the file."""
    run = make_run(tmp_path / "run")
    paths = plot.plot_run(run, times=[0.5], output=tmp_path / "picture")
    assert paths[0] == tmp_path / "picture.png" and paths[0].read_bytes().startswith(PNG)


def test_a_picture_that_fails_halfway_leaves_nothing(tmp_path, monkeypatch):
    """The disk is full: what was there is as it was."""
    run = make_run(tmp_path / "run")
    target = tmp_path / "picture.png"
    target.write_bytes(b"old")

    def fill(_figure, path, **_options):
        with open(path, "wb") as file:
            file.write(PNG)
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", fill)
    with pytest.raises(OutputError, match="the disk is full"):
        plot.plot_run(run, times=[0.5], output=target)
    assert target.read_bytes() == b"old" and not list(tmp_path.glob(".*"))


def test_a_run_without_gauges_gives_one_picture(tmp_path):
    with RunFolder(tmp_path / "run") as folder:
        folder.write_particles(lattice(2, 0.0))
    assert [path.name for path in plot.plot_run(tmp_path / "run")] == ["pressure.png"]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"field": "presure"}, "choose from: .*pressure"),
        ({"field": "curvature"}, "not in the particle files"),
        ({"field": "pressure_x"}, "not in the particle files"),
        ({"slice_axis": "w"}, "choose from: x, y, z"),
    ],
)
def test_what_is_not_there_is_named(tmp_path, arguments, expected):
    with pytest.raises(CaseError, match=expected):
        plot.plot_run(make_run(tmp_path / "run", times=[0.0]), **arguments)


def test_no_such_run(tmp_path):
    with pytest.raises(CaseError, match="no such folder"):
        plot.plot_run(tmp_path / "nothing")
    with pytest.raises(CaseError, match="no particle files"):
        plot.plot_run(tmp_path)


def test_a_slice_of_times_takes_every_frame_within(tmp_path, drawn):
    run = make_run(tmp_path / "run", times=[0.0, 0.1, 0.2, 0.3])
    plot.plot_run(run, times=slice(0.1, 0.3))
    plot.plot_run(run, times=slice(None, 0.15))
    assert [axes.get_title() for axes in panels(drawn[0])] == ["t = 0.1 s", "t = 0.2 s", "t = 0.3 s"]
    assert [axes.get_title() for axes in panels(drawn[2])] == ["t = 0 s", "t = 0.1 s"]
    with pytest.raises(CaseError, match="times: 0.4: -> no frame .* frames from 0 to 0.3 s"):
        plot.plot_run(run, times=slice(0.4, None))


@pytest.mark.parametrize(("times", "told"), [([5.0], "5"), ([0.1, 0.4, -1.0], "0.4,-1"), ([0.302], "0.302")])
def test_a_time_that_the_run_does_not_have_is_refused(tmp_path, times, told):
    """The last frame is not drawn in its place, and nothing is written."""
    run = make_run(tmp_path / "run", times=[0.0, 0.1, 0.3])
    with pytest.raises(CaseError, match=f"times: {told} -> no frame of .*; the run has frames from 0 to 0.3 s") as caught:
        plot.plot_run(run, times=times)
    assert caught.value.exit_code == 2
    assert not (run / "plots").exists()


def test_times_between_frames_and_rounded_ones_are_those_of_the_nearest(tmp_path, drawn):
    run = make_run(tmp_path / "run", times=[0.0, 0.1, 0.29997])
    plot.plot_run(run, times=[0.12, 0.3])
    assert [axes.get_title() for axes in panels(drawn[0])] == ["t = 0.1 s", "t = 0.3 s"]


def test_no_two_curves_of_a_panel_share_a_colour(tmp_path, drawn):
    """Of the extents of two phases there are two dozen in metres; all are in the legend, beside the curves."""
    run = make_run(tmp_path / "run", times=[0.0])
    names = [f"curve_{k}" for k in range(24)]
    heading = "time [s]," + ",".join(f"{name} [m]" for name in names)
    rows = "\n".join(f"{t}," + ",".join(str(k + t) for k in range(24)) for t in (0, 1, 2))
    (run / "gauges" / "extents.csv").write_text(f"{heading}\n{rows}\n")
    plot.plot_run(run)
    (panel,) = [axes for axes in panels(drawn[1]) if axes.get_title() == "extents"]
    looks = [tuple(np.round(to_rgba(line.get_color()), 3)) for line in panel.get_lines()]
    assert len(set(looks)) == 24
    assert [text.get_text() for text in panel.get_legend().get_texts()] == names
    FigureCanvasAgg(drawn[1]).draw()  # arranges the parts
    legend, curves = panel.get_legend().get_window_extent(), panel.get_window_extent()
    assert legend.x0 >= curves.x1 and legend.x1 <= drawn[1].bbox.x1
    for few in [axes for axes in panels(drawn[1]) if axes is not panel]:
        colours = [line.get_color() for line in few.get_lines()]
        assert len(set(colours)) == len(colours)


# ---- reference interfaces over the particles ---------------------------------------------------------------


def table(path, text):
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "heading",
    ["x1,y1,x2,y2", "x1_over_R,y1_over_R,x2_over_R,y2_over_R (right half; segments)", "x1 [m], y1 [m],x2 [m],y2 [m],part"],
)
def test_segments_are_read_scaled_moved_and_mirrored(tmp_path, heading):
    path = table(tmp_path / "a.csv", f"# computed\n{heading}\n1,2,3,4,left\n\n0,0,0.5,-1\n")
    found = read_segments(path)
    np.testing.assert_array_equal(found, [[[1, 2], [3, 4]], [[0, 0], [0.5, -1]]])
    found = read_segments(path, scale=2.0, offset=(10.0, 0.5))
    np.testing.assert_array_equal(found, [[[12, 4.5], [16, 8.5]], [[10, 0.5], [11, -1.5]]])
    both = read_segments(path, scale=2.0, offset=(10.0, 0.5), mirror=11.0)
    np.testing.assert_array_equal(both[:2], found)
    np.testing.assert_array_equal(both[2:], [[[10, 4.5], [6, 8.5]], [[12, 0.5], [11, -1.5]]])


@pytest.mark.parametrize(
    ("text", "keywords", "expected"),
    [
        (None, {}, r"over: .* -> cannot be read: .*; name a CSV file whose first columns are x1, y1, x2, y2"),
        ("", {}, "over: .* -> holds no segments"),
        ("x1,y1,x2,y2\n", {}, "over: .* -> holds no segments"),
        ("x,y\n1,2\n", {}, "over: .* -> its first columns are x, y; name a CSV file"),
        ("x1,x2,y1,y2\n1,2,3,4\n", {}, "its first columns are x1, x2, y1, y2"),
        ("x1,y1,x2\n1,2,3\n", {}, "its first columns are x1, y1, x2;"),
        ("x10,y1,x2,y2\n1,2,3,4\n", {}, "its first columns are x10"),
        ("x1,y1,x2,y2\n1,2,3,4\n1,2,3\n", {}, "line 3 does not begin with four numbers; correct"),
        ("x1,y1,x2,y2\n1,2,3,four\n", {}, "line 2 does not begin with four numbers"),
        ("x1,y1,x2,y2\n1,2,nan,4\n", {}, "line 2 does not begin with four numbers"),
        (b"x1,y1,x2,y2\n\xff\xfe1,2,3,4\n", {}, "is no CSV file"),
        ("x1,y1,x2,y2\n1,2,3,4\n", {"scale": 0.0}, "over_scale: 0.0 -> needs a number other than 0"),
        ("x1,y1,x2,y2\n1,2,3,4\n", {"scale": float("inf")}, "over_scale: .* -> needs finite numbers"),
        ("x1,y1,x2,y2\n1,2,3,4\n", {"offset": (1.0,)}, "over_offset: .* -> needs two numbers; write e.g. 0.5,0"),
        ("x1,y1,x2,y2\n1,2,3,4\n", {"mirror": float("nan")}, "over_mirror: .* -> needs finite numbers"),
        ("x,y\n", {"mirror": float("nan"), "scale": 0.0}, "(?s)over_mirror: .*over_scale: .*over: "),
    ],
)
def test_what_is_no_table_of_segments_is_told(tmp_path, text, keywords, expected):
    path = tmp_path / "a.csv"
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(CaseError, match=expected):
        read_segments(path, **keywords)


def test_segments_are_drawn_apart_on_top_of_every_panel(tmp_path, drawn):
    segments = np.array([[[0.2, 0.3], [0.4, 0.5]], [[7.0, 7.0], [8.0, 8.0]]])
    run = make_run(tmp_path / "run", times=[0.0, 1.0])
    plot.plot_run(run, field="phase")
    plot.plot_run(run, field="phase", over=segments)
    without, with_segments = panels(drawn[0]), panels(drawn[2])
    assert len(with_segments) == 2
    for plain, panel in zip(without, with_segments, strict=True):
        (line,) = panel.lines
        np.testing.assert_array_equal(
            line.get_xydata(), [[0.2, 0.3], [0.4, 0.5], [np.nan] * 2, [7, 7], [8, 8], [np.nan] * 2]
        )
        assert line.get_zorder() > max(collection.get_zorder() for collection in discs(panel))
        assert panel.get_xlim() == plain.get_xlim() and panel.get_ylim() == plain.get_ylim()
        assert not plain.lines


def test_segments_can_be_drawn_on_any_axes():
    from matplotlib.figure import Figure

    panel = Figure().subplots()
    line = plot.draw_segments(panel, np.array([[[0.0, 0.0], [5.0, 5.0]]]), colour="red")
    assert line in panel.lines and line.get_color() == "red"
    assert panel.get_xlim() == panel.get_ylim() == (0, 1)  # limits are not the segments' business


@pytest.mark.parametrize("count", [1, 3, 6])
@pytest.mark.parametrize("aspect", [0.5, 1.2, 3.0])
@pytest.mark.parametrize("width", [1.0, 0.01, 0.0004])
def test_labels_of_ticks_stand_apart(count, aspect, width):
    """In scenes of millimetres "0.0000", "0.0025" and "0.0050" were written over each other."""
    figure, axes = plot._panels(count, aspect)
    view = plot.view_of(np.zeros(3), np.array([width, aspect * width, 0.0]), width / 50, None)
    for panel in axes:
        plot.set_axes(panel, view)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    for panel in axes:
        labels = [text for text in panel.get_xticklabels() if text.get_text()]
        inside = [box for box in (text.get_window_extent() for text in labels) if box.width > 0]
        low, high = panel.get_window_extent().intervalx
        inside = [box for box in inside if low - 1 <= 0.5 * (box.x0 + box.x1) <= high + 1]
        assert len(inside) >= 2
        assert all(left.x1 < right.x0 for left, right in zip(inside, inside[1:], strict=False))
