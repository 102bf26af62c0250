"""Picture of one phase of a 3-D run: its particles in the middle plane above, all of them below, one column a time.

    python scripts/picture_3d.py RUN [--phase gas] [--times T ...] [--every N] [--output FILE.png]

RUN is a run folder with particle files, for example `validation/seed-cuda_0/runs/rising_bubble_3d-R_18` of
`python -m warpsph validate rising_bubble_3d --level seed --device cuda:0`. The vertical axis is z; without `--times` it
shows every second frame. Exit code 2 if the run is not one of three dimensions with particle files.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from warpsph.errors import WarpsphError
from warpsph.files.vtp import read_vtp
from warpsph.study.figures import case_of_run
from warpsph.study.plot import choose_frames


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("--phase", help="default: the phase with the fewest particles")
    parser.add_argument("--times", type=float, nargs="+", metavar="T", help="s; the nearest frames")
    parser.add_argument("--every", type=int, default=2, help="frames from one picture to the next (default: 2)")
    parser.add_argument("--output", type=Path, default=Path("picture_3d.png"))
    chosen = parser.parse_args(arguments)
    try:
        case = case_of_run(chosen.run)
    except WarpsphError as error:
        parser.error(str(error))
    if case.dimension != 3:
        parser.error(f"{chosen.run}: has {case.dimension} dimensions, needs 3")
    if chosen.phase is not None and chosen.phase not in case.phase_names:
        parser.error(f"--phase {chosen.phase}: needs one of {', '.join(case.phase_names)}")
    frames = sorted((chosen.run / "particles").glob("fluid_*.vtp"))
    if not frames:
        parser.error(f"{chosen.run}: has no particle files")
    if chosen.times:
        listed = [(read_vtp(frame).time, str(frame)) for frame in frames]
        try:
            frames = [Path(name) for _, name in choose_frames(listed, chosen.times)]
        except WarpsphError as error:
            parser.error(str(error))
    else:
        frames = frames[:: max(chosen.every, 1)]

    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    lower, upper = np.array(case.domain.lower), np.array(case.domain.upper)
    middle = 0.5 * (lower[1] + upper[1])
    figure = plt.figure(figsize=(2.6 * len(frames), 6.4), layout="constrained")
    for column, frame in enumerate(frames):
        state = read_vtp(frame)
        x = state.position
        counts = np.bincount(state.phase[state.phase >= 0], minlength=len(case.phase_names))
        phase = case.phase_names.index(chosen.phase) if chosen.phase else int(counts.argmin())
        mine = state.phase == phase
        cut = np.abs(x[:, 1] - middle) < 0.75 * state.particle_spacing
        flat = figure.add_subplot(2, len(frames), column + 1)
        for rows, colour, size in ((cut & ~mine, "#bcd7ee", 0.3), (cut & mine, "#c0392b", 1.0)):
            flat.scatter(x[rows, 0], x[rows, 2], s=size, c=colour, linewidths=0)
        flat.set(aspect="equal", xlim=(lower[0], upper[0]), ylim=(lower[2], upper[2]), title=f"{state.time:.3g} s")
        round_ = figure.add_subplot(2, len(frames), len(frames) + column + 1, projection="3d")
        own = x[mine]
        reach = 0.55 * max(float(np.ptp(own, axis=0).max()), state.particle_spacing)
        centre = 0.5 * (own.min(axis=0) + own.max(axis=0))
        round_.scatter(*own.T, s=1.0, c=own[:, 2], cmap="plasma", linewidths=0)
        round_.set(**{f"{a}lim": (centre[k] - reach, centre[k] + reach) for k, a in enumerate("xyz")})
        round_.set_box_aspect((1, 1, 1))
        round_.view_init(12, -60)
        round_.set_axis_off()
    figure.savefig(chosen.output, dpi=90)
    print(chosen.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
