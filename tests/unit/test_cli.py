"""The command line with a faked simulation: what reaches it, what is printed, which exit code comes back."""

import json
import subprocess
import sys
import types
from pathlib import Path
from types import SimpleNamespace

import pytest

import warpsph
from warpsph import cli
from warpsph.case.case_file import load_case
from warpsph.cli import progress
from warpsph.errors import CapacityError, DivergenceError, Interrupted, OutputError, WallTimeReached

ROOT = Path(__file__).resolve().parents[2]
SUMMARY = {
    "steps": 1200,
    "particles": 2704,
    "wall_seconds": 75.0,
    "device": "cpu",
    "precision": "float32",
    "errors": {
        "jump": {"value": 1.75, "reference": 1.72, "error": 0.0174, "allowed": 0.03},
        "decay": {"value": 0.5, "reference": 0.4, "error": -0.25, "allowed": 0.02},
        "lost": {"value": float("nan"), "reference": 0.4, "error": float("nan"), "allowed": 0.02},
        "late": {"value": None, "reference": None, "error": None, "allowed": 0.02, "note": "not reached"},
    },
    "timings": {"density": 1.0, "momentum": 3.0},
}


class FakeSimulation:
    """Records how it was made; `failure` is raised by run."""

    made: list = []
    known = ["phases.water.sound_speed: too low"]
    late: list[str] = []
    failure: BaseException | None = None

    def __init__(self, case, *, output, preparing, **choices):
        preparing(0)
        self.case, self.output, self.choices = case, output, choices
        self.summary = SUMMARY
        self.warnings = list(self.known)
        FakeSimulation.made.append(self)

    def run(self, progress):
        assert self.output.is_dir()
        (self.output / "log.txt").write_text("started\n")
        for share in (0.0, 0.5, 1.0):
            time = share * self.case.end_time
            left = None if share == 0 else 100 * (1 - share)
            progress(
                SimpleNamespace(
                    time=time,
                    end_time=self.case.end_time,
                    step=int(1000 * share),
                    dt=1e-3,
                    mups=2.5,
                    share=share,
                    seconds_left=left,
                )
            )
        self.warnings += self.late
        if self.failure is not None:
            raise self.failure


@pytest.fixture
def simulation(monkeypatch):
    """A warpsph.simulation that computes nothing."""
    module = types.ModuleType("warpsph.simulation")
    module.Simulation = FakeSimulation
    preview = types.ModuleType("warpsph.running.preview")
    preview.estimate = lambda case: {
        "particles": 1600,
        "walls": 704,
        "memory_bytes": 2**20,
        "host_bytes": 3 * 2**20,
        "dt": 1e-3,
        "steps": 500,
        "seconds": 250.0,
        "warnings": ["phases.oil.sound_speed: 1 m/s is too low; needs 5 m/s"],
    }
    preview.describe = lambda case: {
        "resolved": {"dimension": case.dimension, "gravity": [0.0, 0.0]},
        "structure": {"scheme": "riemann", "dimension": 2},
        "reasons": {"shifting": "[not] needed"},
        "stages": [
            {"name": "density", "reason": "continuity", "depth": 0},
            {"name": "momentum", "reason": "[always]", "depth": 1},
        ],
        "absent": [{"name": "gravity", "reason": "gravity is zero"}],
    }
    monkeypatch.setitem(sys.modules, "warpsph.simulation", module)
    monkeypatch.setitem(sys.modules, "warpsph.running.preview", preview)
    monkeypatch.setattr(warpsph, "simulation", module, raising=False)
    monkeypatch.setattr(FakeSimulation, "made", [])
    monkeypatch.setattr(FakeSimulation, "failure", None)
    return FakeSimulation


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    """Run a command line in an empty folder; gives exit code, stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["warpsph", *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
        out, err = capsys.readouterr()
        return stopped.value.code or 0, out, err

    return run


@pytest.fixture
def case(command):
    """A valid case file in the current folder."""
    assert command("new", "drop")[0] == 0
    return Path("drop.yaml")


# ---- run -------------------------------------------------------------------------------------------------


def test_run_hands_the_case_and_the_options_on(command, case, simulation):
    code, out, err = command(
        *("run", case, "--device", "cpu", "--precision", "float64", "--threads", 2, "--end-time", 0.25),
        *("--set", "phases.oil.density=850", "--set", "title=changed", "--output", "here/there"),
    )
    assert code == 0, err
    (made,) = simulation.made
    assert (made.case.precision, made.case.end_time, made.case.title) == ("float64", 0.25, "changed")
    assert made.case.phases["oil"].density == 850
    assert made.output == Path("here/there")
    assert made.choices == {"device": "cpu", "threads": 2}


def test_run_leaves_defaults_to_the_simulation(command, case, simulation):
    assert command("run", case)[0] == 0
    assert simulation.made[0].choices == {}


def test_named_options_win_over_set(command, case, simulation):
    command("run", case, "--end-time", 0.125, "--set", "end_time=3")
    assert simulation.made[0].case.end_time == 0.125


def test_run_prints_progress_and_the_comparison(command, case, simulation):
    code, out, err = command("run", case)
    assert code == 0
    assert "drop.yaml -> runs/drop" in out
    assert "warning: phases.water.sound_speed: too low" in err
    assert "t 0 of 0.2 s  step 0" in out and "? left" in out
    assert "t 0.2 of 0.2 s  step 1000  dt 0.001 s  2.5 Mups  100.0 %" in out
    assert "step 500 " not in out  # less than 5 s after the line before
    rows = {line.split()[0]: line.split() for line in out.splitlines() if line.strip()}
    assert rows["jump"] == ["jump", "1.75", "1.72", "1.74", "%", "3", "%"]
    assert rows["decay"][3:6] == ["!", "-25", "%"]
    assert rows["lost"][3:6] == ["!", "nan", "%"]
    assert rows["late"] == ["late", "2", "%", "not", "reached"]
    assert rows["momentum"] == ["momentum", "3.000", "75.0"]
    assert "2 704 particles, 1 200 steps, 1 min 15 s, cpu float32, runs/drop" in out


@pytest.mark.parametrize("failure", [None, DivergenceError("burst", particle=1, time=0.1, quantity="velocity")])
def test_run_prints_what_it_warns_of_at_its_end(command, case, simulation, monkeypatch, failure):
    """Leaks, spilled particles and solves above their tolerance were in the log alone; each once, failed or not."""
    monkeypatch.setattr(simulation, "late", ["particles beyond a wall: water 3", *simulation.known])
    monkeypatch.setattr(simulation, "failure", failure)
    code, out, err = command("run", case)
    assert code == (0 if failure is None else 3)
    assert err.count("warning: particles beyond a wall: water 3\n") == 1
    assert err.count("warning: phases.water.sound_speed: too low\n") == 1
    assert "warning" not in out


def test_progress_on_a_terminal_draws_a_bar(monkeypatch, capsys):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "150")
    with progress.progress_display() as show_progress:
        show_progress(
            SimpleNamespace(time=1.0, end_time=2.0, step=70, dt=1e-3, mups=2.5, share=0.5, seconds_left=61)
        )
    out = capsys.readouterr().out
    for part in ("1 / 2 s", "50%", "step 70", "2.5 Mups", "1 min 01 s left"):
        assert part in out


def test_the_bar_says_that_kernels_are_compiled(monkeypatch, capsys):
    """And, once they are, that the first step is to come: no bar stands at 0 % without a word."""
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "150")
    with progress.progress_display(transient=True) as display:
        display.preparing(3)
    assert "compiling kernels: 3 ready" in capsys.readouterr().out
    with progress.progress_display():
        pass
    assert "preparing the first step" in capsys.readouterr().out


def test_lines_say_that_kernels_are_compiled(monkeypatch, capsys):
    """From the second on that it takes, every few seconds."""
    now = 100.0
    monkeypatch.setattr(progress.time, "monotonic", lambda: now)
    with progress.progress_display() as display:
        for ready, moment in enumerate((100.5, 101.5, 102.0, 107.0)):
            now = moment
            display.preparing(ready)
    assert capsys.readouterr().out == "compiling kernels: 1 ready\ncompiling kernels: 3 ready\n"


def test_run_folders_are_numbered(command, case, simulation):
    for _ in range(3):
        assert command("run", case)[0] == 0
    assert [made.output for made in simulation.made] == [
        Path("runs/drop"),
        Path("runs/drop_2"),
        Path("runs/drop_3"),
    ]


def test_a_folder_in_use_is_refused_with_all_other_problems(command, case, simulation):
    Path("used").mkdir()
    Path("used/thing").touch()
    code, _, err = command(
        *(
            "run",
            case,
            "--output",
            "used",
            "--set",
            "end_time=-1",
            "--restart",
            "nowhere",
            "--device",
            "cuda:99",
        )
    )
    assert code == 2 and not simulation.made
    for part in (
        "--output: used -> folder in use",
        "end_time: -1 ->",
        "--restart: nowhere",
        "--device: cuda:99",
    ):
        assert part in err
    assert "Traceback" not in err
    assert [path.name for path in Path("used").iterdir()] == ["thing"]


def test_an_output_that_is_a_file_is_refused(command, case, simulation):
    assert command("run", case, "--output", case)[0] == 2
    code, _, err = command("run", case, "--output", case / "below")
    assert (code, "Traceback" in err) == (4, False) and "drop.yaml" in err


def test_an_empty_output_folder_is_taken(command, case, simulation):
    Path("empty").mkdir()
    assert command("run", case, "--output", "empty")[0] == 0


@pytest.mark.parametrize(
    "given", ["runs/drop", "runs/drop/checkpoint", "runs/drop/checkpoint/step_000000001.h5"]
)
def test_restart_goes_on_in_the_folder_of_the_run(command, case, simulation, given):
    checkpoint = Path("runs/drop/checkpoint/step_000000001.h5")
    checkpoint.parent.mkdir(parents=True)
    checkpoint.touch()
    assert command("run", case, "--restart", given)[0] == 0
    assert command("run", case, "--restart", given, "--output", "runs/drop")[0] == 0
    assert command("run", case, "--restart", given, "--output", "other")[0] == 0
    assert [made.output for made in simulation.made] == [Path("runs/drop"), Path("runs/drop"), Path("other")]
    assert [made.choices for made in simulation.made] == [{"restart": Path(given)}] * 3


@pytest.mark.parametrize(
    ("failure", "code", "message"),
    [
        (DivergenceError("velocity is nan", particle=7, time=0.1, quantity="velocity"), 3, "velocity is nan"),
        (OutputError("disk full"), 4, "disk full"),
        (CapacityError("too many neighbours"), 5, "numerics.neighbour_capacity"),
        (WallTimeReached("stopped at t = 0.1 s"), 7, "stopped at t = 0.1 s"),
        (Interrupted("stopped at t = 0.1 s"), 130, "stopped at t = 0.1 s"),
        (KeyboardInterrupt(), 130, "interrupted"),
    ],
)
def test_failures_have_their_exit_code_and_no_traceback(command, case, simulation, failure, code, message):
    simulation.failure = failure
    found, _, err = command("run", case)
    assert found == code
    assert message in err and "Traceback" not in err


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("90", 90.0), ("0.5", 0.5), ("1h30m", 5400.0), ("1d2h3m4.5s", 93784.5), ("20min", 1200.0), ("1h 5s", 3605.0),
     ("01:30:00", 5400.0), ("100:00:01", 360001.0)],
)  # fmt: skip
def test_wall_time_in_seconds(command, case, simulation, text, seconds):
    assert command("run", case, "--wall-time", text)[0] == 0
    assert simulation.made[0].choices == {"wall_time": seconds}


@pytest.mark.parametrize("text", ["0", "-5", "nan", "inf", "soon", "1:30", "30m1h", "1:61:00", "", "0h0m"])
def test_a_wall_time_that_is_none_is_refused(command, case, simulation, text):
    code, _, err = command("run", case, "--wall-time", text)
    assert code == 2 and not simulation.made
    assert "--wall-time" in err and "needs a time above 0; write seconds, e.g. 5400, or 1h30m, or 01:30:00" in err


def test_an_unexpected_failure_leaves_its_traceback_in_the_run_folder(command, case, simulation):
    simulation.failure = ZeroDivisionError("oh")
    code, _, err = command("run", case)
    assert code == 1
    assert "unexpected ZeroDivisionError: oh" in err and "runs/drop/traceback.txt" in err
    assert "Traceback" not in err
    text = Path("runs/drop/traceback.txt").read_text()
    assert "raise self.failure" in text and "run drop.yaml" in text


def test_debug_raises_it(command, case, simulation, monkeypatch):
    simulation.failure = ZeroDivisionError("oh")
    monkeypatch.setattr(sys, "argv", ["warpsph", "run", str(case), "--debug"])
    with pytest.raises(ZeroDivisionError):
        cli.main()


def test_debug_shows_the_traceback_of_an_expected_error_and_keeps_its_code(command, case, simulation):
    simulation.failure = OutputError("disk full")
    code, _, err = command("run", case, "--debug")
    assert code == 4 and "Traceback" in err


def test_a_run_that_wrote_nothing_leaves_no_folder(command, case, simulation, monkeypatch):
    def refuse(self, case, **_):
        raise OutputError("no")

    monkeypatch.setattr(FakeSimulation, "__init__", refuse)
    assert command("run", case)[0] == 4
    assert not Path("runs/drop").exists()


def test_dry_run_checks_and_shows(command, case, simulation):
    code, out, _ = command("run", case, "--dry-run")
    assert code == 0 and not simulation.made and not Path("runs").exists()
    assert "fluid particles" in out and "Stages of one step" in out


# ---- check, show, new, schema, plot, info ----------------------------------------------------------------


def test_check_prints_the_estimate_and_warnings(command, case, simulation):
    code, out, err = command("check", case, "--set", "title=drop [red] 1")
    assert code == 0
    for part in ("drop [red] 1", "1 600", "704", "1.0 MiB", "0.001 s", "500", "4 min 10 s"):
        assert part in out
    assert "warning: phases.oil.sound_speed" in err


def test_show_prints_the_case_and_why_each_stage_is_there(command, case, simulation):
    code, out, _ = command("show", case)
    assert code == 0
    assert "dimension: 2" in out and "gravity: [0.0, 0.0]" in out
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert "1 density continuity" in lines
    assert "2 momentum [always]" in lines  # brackets are text, not markup
    assert "gravity gravity is zero" in lines
    assert "shifting [not] needed" in lines  # why `auto` came to what it came to


@pytest.mark.parametrize("name", ["check", "show", "run"])
@pytest.mark.parametrize("content", ["dimension: 2\ndomian: 1\n", "[1, 2", "", "\x00\x01", "- 1\n"])
def test_a_broken_case_exits_with_2_and_no_traceback(command, simulation, name, content):
    Path("broken.yaml").write_text(content)
    code, _, err = command(name, "broken.yaml")
    assert code == 2 and err.strip() and "Traceback" not in err


@pytest.mark.parametrize("setting", ["nonsense", "end_time", "phases.oil.densty=1", "=3", "end_time=[1"])
def test_a_broken_set_exits_with_2_and_no_traceback(command, case, simulation, setting):
    code, _, err = command("check", case, "--set", setting)
    assert code == 2 and err.strip() and "Traceback" not in err


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "{long}"),
        ("run", "{case}", "--output", "{long}"),
        ("run", "{case}", "--restart", "{long}"),
        ("run", "{case}", "--set", "numerics.kernel={long}"),
        ("run", "{case}", "--device", "{long}"),
        ("new", "{long}"),
        ("plot", "{long}"),
        ("validate", "{long}", "--dry-run"),
        ("validate", "--cases", "{long}", "--dry-run"),
    ],
    ids=" ".join,
)
def test_long_arguments_are_not_echoed_whole(command, case, simulation, arguments):
    given = [part.format(long=5000 * "so_long_", case=case) for part in arguments]
    code, out, err = command(*given)
    assert code in (2, 4) and "so_long_" in err and "Traceback" not in err
    assert len(err) < 2000 and not out and not simulation.made


def test_no_such_case(command):
    code, _, err = command("check", "nothing.yaml")
    assert code == 2 and "nothing.yaml" in err and "Traceback" not in err


def test_new_writes_a_valid_case_under_its_name(command):
    code, out, _ = command("new", "wet")
    assert code == 0 and "wet.yaml" in out
    text = Path("wet.yaml").read_text()
    assert "python -m warpsph run wet.yaml" in text and "NAME" not in text
    case = load_case(Path("wet.yaml"))
    assert case.dimension == 2 and list(case.phases) == ["oil", "water"]


def test_new_never_overwrites(command):
    Path("mine.yaml").write_text("precious")
    code, _, err = command("new", "mine")
    assert code == 2 and "mine.yaml -> exists already" in err
    assert command("new", "mine.yaml")[0] == 2
    assert Path("mine.yaml").read_text() == "precious"


def test_new_in_a_folder_that_is_not_there(command):
    code, _, err = command("new", "no/where")
    assert code == 4 and "no/where.yaml" in err and "Traceback" not in err


def test_schema_is_json_schema(command):
    code, out, _ = command("schema")
    properties = json.loads(out)["properties"]
    assert code == 0 and {"particle_spacing", "end_time", "phases", "gauges"} <= set(properties)


def test_plot_passes_its_options_on(command, monkeypatch):
    import warpsph.study.plot

    calls = []
    monkeypatch.setattr(
        warpsph.study.plot, "plot_run", lambda *args, **keywords: calls.append((args, keywords)) or [Path("a.png")]
    )
    code, out, _ = command("plot", "runs/x", "--field", "speed", "--times", "0,1.5", "--output", "a.png")
    assert (code, out) == (0, "a.png\n")
    assert calls == [((Path("runs/x"),), {"field": "speed", "times": [0.0, 1.5], "output": Path("a.png")})]


@pytest.fixture
def plotted(monkeypatch):
    """Keywords of the calls that draw or film a run, with the name of the function."""
    import warpsph.study.movie
    import warpsph.study.plot

    calls = []
    monkeypatch.setattr(
        warpsph.study.plot, "plot_run", lambda *args, **keywords: calls.append(("plot", args, keywords)) or [Path("a.png")]
    )

    def make_movie(*args, progress, **keywords):
        progress(1, 2)
        progress(2, 2)
        calls.append(("movie", args, keywords))
        return Path("a.gif")

    monkeypatch.setattr(warpsph.study.movie, "make_movie", make_movie)
    return calls


@pytest.mark.parametrize(
    ("text", "times"),
    [
        ("1", [1.0]),
        ("0,1.5", [0.0, 1.5]),
        ("0.5:2", slice(0.5, 2.0)),
        (":2", slice(None, 2.0)),
        ("1e-3:", slice(0.001, None)),
        (":", slice(None, None)),
    ],
)
def test_plot_takes_times_or_a_range_of_them(command, plotted, text, times):
    assert command("plot", "runs/x", "--times", text)[0] == 0
    assert command("plot", "runs/x", "--times", text, "--movie", "a.gif")[0] == 0
    assert [keywords["times"] for _, _, keywords in plotted] == [times, times]


def test_plot_takes_phases_of_pictures_and_movies(command, plotted):
    for more in ((), ("--movie", "a.gif")):
        assert command("plot", "runs/x", "--phases", "salt water, oil", *more)[0] == 0
    assert [keywords["phases"] for _, _, keywords in plotted] == [["salt water", "oil"]] * 2


def test_plot_makes_a_movie_and_shows_how_far_it_is(command, plotted):
    code, out, err = command("plot", "runs/x", "--movie", "new/a.gif", "--fps", 25, "--field", "phase")
    assert (code, out) == (0, "a.gif\n")
    assert "frame 2 of 2" in err and "frame 1" not in err  # less than 5 s after the start
    expected = {"field": "phase", "times": None, "fps": 25.0}
    assert plotted == [("movie", (Path("runs/x"), Path("new/a.gif")), expected)]
    command("plot", "runs/x", "--movie", "a.gif")
    assert "fps" not in plotted[1][2]


def test_movie_progress_on_a_terminal_draws_a_bar(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    with progress.frame_progress() as show_progress:
        show_progress(30, 70)
    out, err = capsys.readouterr()
    assert "30/70" in err and not out


def test_plot_draws_segments_over_pictures_and_movies(command, plotted):
    Path("a.csv").write_text("x1,y1,x2,y2\n1,2,3,4\n")
    options = ("--over", "a.csv", "--over-scale", 2, "--over-offset", "0.5,-1", "--over-mirror", -1)
    assert command("plot", "runs/x", *options)[0] == 0
    assert command("plot", "runs/x", "--over", "a.csv", "--movie", "a.gif")[0] == 0
    moved = [[[2.5, 3.0], [6.5, 7.0]], [[-4.5, 3.0], [-8.5, 7.0]]]
    assert plotted[0][2]["over"].tolist() == moved
    assert plotted[1][2]["over"].tolist() == [[[1.0, 2.0], [3.0, 4.0]]]


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (("--over-scale", 2, "--over-offset", "1,1"), ["--over-scale: 2.0 -> ", "--over-offset: 1,1 -> ", "add --over"]),
        (("--over-mirror", 0), ["--over-mirror: 0.0 -> there is nothing to draw over; add --over FILE.csv"]),
        (("--fps", 10), ["--fps: 10.0 -> a picture has no frames; add --movie FILE.gif"]),
        (("--movie", "a.gif", "--output", "a.png"), ["--output: a.png -> ", "leave --output or --movie out"]),
        (("--over", "none.csv"), ["over: none.csv -> cannot be read"]),
        (("--times", "now"), ["--times"]),
        (("--times", "0:now"), ["--times"]),
        (("--times", "0,1:2"), ["--times", "e.g. 0:1"]),
        (("--times", "0:1:2"), ["--times"]),
        (("--times", "nan"), ["--times"]),
        (("--over", "a.csv", "--over-offset", "right"), ["--over-offset"]),
    ],
)
def test_plot_refuses_options_that_make_no_sense(command, plotted, options, expected):
    code, _, err = command("plot", "runs/x", *options)
    assert code == 2 and not plotted and "Traceback" not in err
    assert all(part in err for part in expected)


def test_plot_refuses_what_is_not_there(command):
    assert command("plot", "nowhere")[0] == 2
    assert command("plot", "nowhere", "--movie", "a.gif")[0] == 2


def test_info_names_versions_devices_and_the_kernel_cache(command):
    code, out, _ = command("info")
    assert code == 0
    for part in (warpsph.__version__, "warp-lang", "numpy", "device cpu", "CPU threads", "kernel cache"):
        assert part in out


# ---- start-up --------------------------------------------------------------------------------------------


def test_help_loads_nothing_heavy():
    """What makes `--help` answer at once: 0.1 s, where importing Warp, NumPy or rich takes 0.2 to 2 s."""
    code = (
        "import sys\nfrom warpsph.cli import app\n"
        "try:\n    app(['--help'])\nexcept SystemExit:\n    pass\n"
        "print('loaded:', *sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    text, loaded = done.stdout.split("loaded:")
    for name in ("run", "check", "show", "new", "schema", "plot", "info"):
        assert f"\n  {name} " in text
    heavy = {
        "warp",
        "numpy",
        "pydantic",
        "rich",
        "ruamel.yaml",
        "h5py",
        "pyvista",
        "vtk",
        "matplotlib",
        "scipy",
    }
    assert not heavy & set(loaded.split())


def test_module_entry_point():
    done = subprocess.run(
        [sys.executable, "-m", "warpsph", "run", "--help"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    options = (
        "--device",
        "--precision",
        "--threads",
        "--output",
        "--set",
        "--end-time",
        "--restart",
        "--dry-run",
    )
    assert all(option in done.stdout for option in options)


@pytest.mark.parametrize(
    "arguments", [("frobnicate",), ("run",), ("run", "x.yaml", "--threads", "0"), ("run", "x", "--wat")]
)
def test_wrong_usage_exits_with_2(command, arguments):
    code, _, err = command(*arguments)
    assert code == 2 and "Usage" in err
