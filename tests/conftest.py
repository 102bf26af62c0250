"""Fixtures and options shared by all tests.

`device` runs a test on the CPU and, where there is one, on the first CUDA device. Tests marked `slow` run
only with --validate, tests marked `cuda` only where there is a CUDA device.
"""

import functools

import pytest


def pytest_addoption(parser):
    parser.addoption("--validate", action="store_true", help="also run the validation tests marked `slow`")


@functools.cache
def cuda_available() -> bool:
    """Start Warp, quietly, and ask it. Only called once a test needs to know: it takes half a second."""
    import warp

    if hasattr(warp.config, "log_level"):
        warp.config.log_level = warp.LOG_WARNING
    else:
        warp.config.quiet = True
    warp.init()
    return warp.is_cuda_available()


def pytest_generate_tests(metafunc):
    if "device" not in metafunc.fixturenames:
        return
    if metafunc.definition.get_closest_marker("cuda"):
        devices = ["cuda:0"]
    else:
        devices = ["cpu", "cuda:0"] if cuda_available() else ["cpu"]
    metafunc.parametrize("device", devices, indirect=True, scope="session")


def pytest_collection_modifyitems(config, items):
    if not config.getoption("--validate"):
        slow = [item for item in items if item.get_closest_marker("slow")]
        if slow:
            config.hook.pytest_deselected(items=slow)
            items[:] = [item for item in items if not item.get_closest_marker("slow")]
    for item in items:
        if item.get_closest_marker("cuda") and not cuda_available():
            item.add_marker(pytest.mark.skip(reason="no CUDA device on this machine"))


@pytest.fixture(scope="session")
def device(request) -> str:
    """Name of the device to test on: "cpu" or "cuda:0"."""
    return request.param
