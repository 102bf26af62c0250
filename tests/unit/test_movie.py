"""Movies from a run folder that is made by hand: which frames, colours, sizes, and nothing left half done."""

import sys

import numpy as np
import pytest
from matplotlib import colormaps
from PIL import Image

from tests.unit.test_plot import SPACING, make_run
from warpsph.errors import CaseError, OutputError
from warpsph.study import movie, plot


@pytest.fixture
def painters(monkeypatch):
    """The painters that movies are made with; each keeps what it painted in `pictures`."""
    made = []

    class Recording(movie._Painter):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            self.pictures = []
            made.append(self)

        def paint(self, frame):
            self.pictures.append(super().paint(frame))
            return self.pictures[-1]

    monkeypatch.setattr(movie, "_Painter", Recording)
    return made


def colour_at(painter, picture, x, y):
    """(3,) colour of a place in the scene."""
    right, up = painter._panel.transData.transform((x, y))
    return picture[len(picture) - 1 - int(up), int(right)]


def gif_of(path):
    """Pictures of a GIF and how long each is shown [ms]."""
    with Image.open(path) as gif:
        pictures, durations = [], []
        for number in range(gif.n_frames):
            gif.seek(number)
            durations.append(gif.info["duration"])
            pictures.append(np.asarray(gif.convert("RGB")))
    return pictures, durations


def test_every_frame_is_in_the_gif_for_its_time(tmp_path, painters):
    run = make_run(tmp_path / "run", times=[0.0, 0.5, 1.0])
    done = []
    path = tmp_path / "new" / "a.gif"
    found = movie.make_movie(run, path, fps=30, progress=lambda *count: done.append(count))
    assert found == path and [entry.name for entry in path.parent.iterdir()] == ["a.gif"]
    assert done == [(1, 3), (2, 3), (3, 3)]
    pictures, durations = gif_of(path)
    assert durations == [30, 40, 30]  # in whole hundredths; 3 frames at 30 a second last 0.1 s
    for shown, painted in zip(pictures, painters[0].pictures, strict=True):
        assert shown.shape == painted.shape
        # the palette holds these colours but for rounding and the rims of discs
        assert np.quantile(np.abs(shown.astype(int) - painted).max(axis=2), 0.95) <= 8
    assert (pictures[0][0, 0] == 255).all()


@pytest.mark.parametrize("most_discs", [10_000, 0], ids=["discs", "pixels"])
def test_one_colour_scale_for_all_frames_and_grey_walls(tmp_path, painters, monkeypatch, most_discs):
    monkeypatch.setattr(movie, "MOST_DISCS", most_discs)
    movie.make_movie(make_run(tmp_path / "run", times=[0.0, 1.0, 2.0]), tmp_path / "a.gif")
    (painter,) = painters
    for time, picture in zip([0.0, 1.0, 2.0], painter.pictures, strict=True):
        for x in (0.05, 0.55, 0.95):  # pressure = x + t, from 0.05 to 2.95
            expected = np.array(colormaps["viridis"]((x + time - 0.05) / 2.9, bytes=True)[:3], int)
            assert np.abs(colour_at(painter, picture, x, 0.55) - expected).max() <= 2
        assert (colour_at(painter, picture, 0.55, 0.05) == 191).all()  # the layer of wall particles, 0.75
        assert (colour_at(painter, picture, 0.55, -0.35 * SPACING) == 255).all()
    assert len({picture.tobytes() for picture in painter.pictures}) == 3


def test_pixels_leave_no_gaps_between_the_particles_of_a_lattice(tmp_path, painters, monkeypatch):
    monkeypatch.setattr(movie, "MOST_DISCS", 0)
    movie.make_movie(make_run(tmp_path / "run", times=[0.0]), tmp_path / "a.gif")
    (painter,) = painters
    for x, y in np.random.default_rng(1).uniform(0.1, 0.9, (200, 2)):
        assert (colour_at(painter, painter.pictures[0], x, y) != 255).any()


def particle(x, y):
    """A frame of one particle."""
    ones = np.ones(1)
    fluid = plot.Snapshot(
        time=0.0, step=0, dt=0.0, dimension=3, position=np.array([[x, y, 0.0]]), velocity=np.zeros((1, 3)),
        density=ones, pressure=ones, mass=ones, volume=ones, phase=np.zeros(1, np.int32),
        particle_id=np.zeros(1, np.int64), kind=np.zeros(1, np.uint8), particle_spacing=0.1,
    )  # fmt: skip
    return plot.Frame(0.0, fluid, None)


@pytest.mark.parametrize("most_discs", [10_000, 0], ids=["discs", "pixels"])
def test_particles_do_not_hide_the_frame_of_the_axes(monkeypatch, most_discs):
    monkeypatch.setattr(movie, "MOST_DISCS", most_discs)
    view = plot.view_of(np.zeros(3), np.array([1.0, 1.0, 0.0]), 0.1, None)
    painter = movie._Painter(view, plot.scale_of("pressure", np.arange(3.0)), [], str, None)
    picture = painter.paint(particle(-0.1, 0.5))
    assert (colour_at(painter, picture, -0.07, 0.5) != 255).any()
    pixel = 1.2 / painter._panel.bbox.width
    line = [colour_at(painter, picture, -0.1 + k * pixel, 0.5) for k in (-1, 0, 1)]
    assert any((colour < 60).all() for colour in line)  # on the left, set to a whole pixel


def test_the_size_is_even_for_any_shape_of_scene():
    scale = plot.scale_of("pressure", np.arange(3.0))
    for width, height in ((1.0, 1.0), (3.217, 0.2), (0.1, 7.77)):
        view = plot.view_of(np.zeros(3), np.array([width, height, 0.0]), 0.01, None)
        painter = movie._Painter(view, scale, [], str, None)
        assert painter.size[0] % 2 == painter.size[1] % 2 == 0 and max(painter.size) < 1200
        assert painter.paint(particle(0.0, 0.0)).shape == (painter.size[1], painter.size[0], 3)


@pytest.mark.parametrize("most_discs", [10_000, 0], ids=["discs", "pixels"])
def test_a_particle_that_moved_on_is_gone(monkeypatch, most_discs):
    monkeypatch.setattr(movie, "MOST_DISCS", most_discs)
    view = plot.view_of(np.zeros(3), np.array([1.0, 1.0, 0.0]), 0.1, None)
    painter = movie._Painter(view, plot.scale_of("pressure", np.arange(3.0)), [], str, None)
    for x, other in ((0.3, 0.7), (0.7, 0.3)):
        picture = painter.paint(particle(x, 0.5))
        assert (colour_at(painter, picture, x, 0.5) != 255).any()
        assert (colour_at(painter, picture, other, 0.5) == 255).all()


@pytest.mark.parametrize(
    ("times", "titles"),
    [
        (None, ["t = 0.00 s", "t = 0.50 s", "t = 1.00 s", "t = 1.50 s", "t = 2.00 s"]),
        (slice(0.5, 1.5), ["t = 0.50 s", "t = 1.00 s", "t = 1.50 s"]),
        (slice(1.2, None), ["t = 1.50 s", "t = 2.00 s"]),
        ([2.0, 0.1], ["t = 0.0 s", "t = 2.0 s"]),
    ],
)
def test_times_choose_the_frames(tmp_path, painters, monkeypatch, times, titles):
    shown = []
    paint = movie._Painter.paint

    def note(self, frame):
        picture = paint(self, frame)
        shown.append(self._title.get_text())
        return picture

    monkeypatch.setattr(movie._Painter, "paint", note)
    movie.make_movie(make_run(tmp_path / "run"), tmp_path / "a.gif", times=times)
    assert shown == titles


def test_a_slice_in_three_dimensions(tmp_path, painters):
    movie.make_movie(make_run(tmp_path / "run", dimension=3, times=[0.0]), tmp_path / "a.gif", slice_axis="y")
    (painter,) = painters
    assert (painter._panel.get_xlabel(), painter._panel.get_ylabel()) == ("x [m]", "z [m]")
    assert painter._panel.figure.get_suptitle() == "slice at y = 0.5 m"
    (picture,) = painter.pictures
    shown = np.asarray(painter._pixels.get_array())
    assert painter._fluid is None and (shown[:, :, 3] > 0).mean() == pytest.approx(1 / 1.1**2, rel=0.06)
    assert (colour_at(painter, picture, 0.55, 0.55) < 250).any()  # at a corner of four lattice cells, where no disc reaches


def test_segments_are_drawn_over_every_frame(tmp_path, painters):
    run = make_run(tmp_path / "run", times=[0.0, 1.0])
    segments = np.array([[[0.2, 0.55], [0.8, 0.55]]])
    movie.make_movie(run, tmp_path / "a.gif", field="phase", over=segments)
    (painter,) = painters
    for picture in painter.pictures:
        assert (colour_at(painter, picture, 0.45, 0.55) < 60).all()
        assert (colour_at(painter, picture, 0.45, 0.75) > 60).any()


def test_phases_that_are_left_out_are_white_and_the_picture_stays_the_same_part_of_the_scene(tmp_path, painters):
    run = make_run(tmp_path / "run", times=[0.0, 1.0])
    for phases in (None, ["gas"]):
        movie.make_movie(run, tmp_path / "a.gif", field="pressure", phases=phases)
    everything, gas = painters
    assert (everything.view.lower == gas.view.lower).all() and (everything.view.upper == gas.view.upper).all()
    for picture in gas.pictures:
        assert (colour_at(gas, picture, 0.75, 0.55) == 255).all() and (colour_at(gas, picture, 0.25, 0.55) < 255).any()
    assert gas.scale.norm.vmax < everything.scale.norm.vmax


def test_phases_on_white_stay_on_white(tmp_path):
    movie.make_movie(make_run(tmp_path / "run", times=[0.0]), tmp_path / "a.gif", field="phase")
    pictures, _ = gif_of(tmp_path / "a.gif")
    white = (pictures[0] == 255).all(axis=2).mean()
    assert white > 0.3


def test_each_pixel_belongs_to_the_nearest_particle():
    random = np.random.default_rng(3)
    position = random.uniform(-0.3, 1.3, (400, 2))
    position[5], position[6] = np.nan, np.inf
    lower, upper, shape, radius = np.array([0.0, 0.25]), np.array([1.0, 0.75]), (20, 40), 0.04
    found = movie.nearest_particles(position, lower, upper, shape, radius)
    assert found.shape == shape
    covered = 0
    for row in range(shape[0]):
        for column in range(shape[1]):
            centre = lower + np.array([column + 0.5, row + 0.5]) / 40
            distance = np.nan_to_num(np.linalg.norm(position - centre, axis=1), nan=9.0, posinf=9.0)
            nearest = int(distance.argmin())
            assert found[row, column] == (nearest if distance[nearest] <= radius else -1)
            covered += found[row, column] >= 0
    assert 300 < covered < 800


def test_a_particle_smaller_than_a_pixel_is_seen():
    position = np.array([[0.31, 0.69], [0.62, 0.1]])
    found = movie.nearest_particles(position, np.zeros(2), np.ones(2), (5, 5), 1e-6)
    assert found[3, 1] == 0 and found[0, 3] == 1 and (found >= 0).sum() <= 4


def test_samples_keep_the_extremes():
    values = np.random.default_rng(2).normal(size=100_001)
    values[7] = np.nan
    sample = movie._sample(values)
    finite = values[np.isfinite(values)]
    assert len(sample) == movie._SAMPLES and sample[0] == finite.min() and sample[-1] == finite.max()
    assert np.median(sample) == pytest.approx(np.median(finite), abs=1e-3)
    assert len(movie._sample(values[:20])) == 19


@pytest.mark.parametrize(
    ("name", "keywords", "expected"),
    [
        ("a.mov", {}, "movie: .* -> .*name a .gif or an .mp4"),
        ("a", {}, "movie: .*name a .gif or an .mp4"),
        ("a.gif", {"fps": 51}, "fps: 51 -> .*at most 50"),
        ("a.gif", {"fps": 0}, "fps: 0 -> "),
        ("a.gif", {"fps": float("nan")}, "fps: nan -> "),
        ("a.mp4", {}, "an .mp4 needs the program ffmpeg.*install ffmpeg.*or name a .gif"),
        ("folder.gif", {}, "movie: .*is a folder"),
        ("a.gif", {"field": "presure"}, "field: presure -> .*choose from: .*pressure"),
        ("a.gif", {"times": slice(7.0, 8.0)}, "times: 7:8 -> .*frames from 0 to 1 s"),
        ("a.gif", {"slice_axis": "w"}, "slice_axis: w -> "),
    ],
)
def test_what_cannot_be_made_is_told_with_a_remedy(tmp_path, monkeypatch, name, keywords, expected):
    monkeypatch.setattr(movie, "ffmpeg", lambda: None)
    run = make_run(tmp_path / "run", times=[0.0, 1.0])
    (tmp_path / "folder.gif").mkdir()
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(CaseError, match=expected):
        movie.make_movie(run, tmp_path / name, **keywords)
    assert sorted(tmp_path.rglob("*")) == before


def test_both_problems_of_a_command_at_once(tmp_path, monkeypatch):
    monkeypatch.setattr(movie, "ffmpeg", lambda: None)
    with pytest.raises(CaseError) as caught:
        movie.make_movie(tmp_path, tmp_path / "a.mp4", fps=-1)
    assert [problem.path for problem in caught.value.problems] == ["fps", "movie"]


def test_no_such_run(tmp_path):
    with pytest.raises(CaseError, match="no such folder"):
        movie.make_movie(tmp_path / "nothing", tmp_path / "a.gif")


@pytest.mark.parametrize("name", ["a.gif", "a.mp4"])
def test_what_is_stopped_half_way_leaves_the_old_movie(tmp_path, monkeypatch, name):
    monkeypatch.setattr(movie, "ffmpeg", lambda: fake_ffmpeg(tmp_path, COPY))
    run = make_run(tmp_path / "run", times=[0.0, 1.0])
    folder = tmp_path / "movies"
    folder.mkdir()
    (folder / name).write_bytes(b"old")

    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        movie.make_movie(run, folder / name, progress=stop)
    assert [path.name for path in folder.iterdir()] == [name] and (folder / name).read_bytes() == b"old"


def test_a_place_that_cannot_be_written(tmp_path):
    run = make_run(tmp_path / "run", times=[0.0])
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot be written"):
        movie.make_movie(run, tmp_path / "file" / "a.gif")


# ---- ffmpeg ----------------------------------------------------------------------------------------------

COPY = "open(sys.argv[-1], 'wb').write((' '.join(sys.argv[1:]) + chr(10)).encode() + sys.stdin.buffer.read())"
FAIL = "sys.stdin.buffer.read(1000); sys.stderr.write('first\\nno such encoder\\n'); sys.exit(1)"


def fake_ffmpeg(folder, body):
    path = folder / "ffmpeg"
    path.write_text(f"#!{sys.executable}\nimport sys\n{body}\n")
    path.chmod(0o755)
    return str(path)


posix = pytest.mark.skipif(sys.platform == "win32", reason="a script stands in for ffmpeg")


@posix
def test_ffmpeg_gets_every_picture_at_its_size_and_rate(tmp_path, monkeypatch, painters):
    monkeypatch.setattr(movie, "ffmpeg", lambda: fake_ffmpeg(tmp_path, COPY))
    movie.make_movie(make_run(tmp_path / "run", times=[0.0, 1.0]), tmp_path / "a.mp4", fps=12.5)
    command, _, pixels = (tmp_path / "a.mp4").read_bytes().partition(b"\n")
    width, height = painters[0].size
    assert f"-video_size {width}x{height} -framerate 12.5" in command.decode()
    assert pixels == b"".join(picture.tobytes() for picture in painters[0].pictures)


@posix
def test_what_ffmpeg_says_reaches_the_user(tmp_path, monkeypatch):
    monkeypatch.setattr(movie, "ffmpeg", lambda: fake_ffmpeg(tmp_path, FAIL))
    with pytest.raises(OutputError, match=r"a\.mp4: ffmpeg failed: no such encoder; name a \.gif"):
        movie.make_movie(make_run(tmp_path / "run"), tmp_path / "a.mp4")
    assert not list(tmp_path.glob("*a.mp4*"))


@posix
def test_ffmpeg_is_the_one_that_matplotlib_is_set_to(tmp_path):
    from matplotlib import rc_context

    path = fake_ffmpeg(tmp_path, COPY)
    with rc_context({"animation.ffmpeg_path": path}):
        assert movie.ffmpeg() == path
    with rc_context({"animation.ffmpeg_path": "no-such-ffmpeg-anywhere"}):
        assert movie.ffmpeg() is None


@pytest.mark.skipif(movie.ffmpeg() is None, reason="no ffmpeg on this machine")
def test_an_mp4_with_the_real_ffmpeg(tmp_path):
    path = movie.make_movie(make_run(tmp_path / "run"), tmp_path / "a.mp4")
    assert path.read_bytes()[4:8] == b"ftyp"
