"""`scripts/foreign`: scenes that show what is not right yet are scenes, and each has its row in the record."""

from pathlib import Path

import pytest

from warpsph.case.case_file import load_case

ROOT = Path(__file__).resolve().parents[2]
SCENES = sorted((ROOT / "scripts" / "foreign").glob("*.yaml"))


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_scenes_can_be_read_and_are_told_of(path):
    assert load_case(path).title
    assert f"`{path.stem}`" in (ROOT / "docs" / "records" / "foreign.md").read_text(encoding="utf-8")
