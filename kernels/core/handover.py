"""Handing a kernel from one thread of a CPU to others without the interpreter between them."""

import functools
from typing import Any

import warp as wp

# What the first word of a helper's box says. A helper that is CALLED or ASLEEP listens to its inbox in Python.
ASLEEP, AWAKE, POSTED, CLAIMED, CALLED = 0, 1, 2, 3, 4
# What the third word of a job says after a launch of `post`.
DONE, NOBODY, WAITING = 0, 1, 2
OWN_WORDS, HELPER_WORDS = 6, 3  # of a job: its own, and of each helper that takes part

_PAUSE = """
#if defined(__x86_64__) || defined(__i386__)
        __builtin_ia32_pause();
#elif defined(__aarch64__)
        __asm__ volatile("yield");
#endif
"""

_SERVE = f"""
    typedef void (*Kernel)(void*, void*);
    long long* state = (long long*)box;
    long long left = patience;
    while (true) {{
        long long now = __atomic_load_n(state, __ATOMIC_ACQUIRE);
        if (now == {POSTED}) {{
            ((Kernel)state[1])((void*)state[2], (void*)state[3]);
            __atomic_store_n(state, (long long){AWAKE}, __ATOMIC_RELEASE);
            left = patience;
            continue;
        }}
        long long awake = {AWAKE};
        if (now == {CALLED}) return;
        if (now == {AWAKE} && left-- <= 0 && __atomic_compare_exchange_n(state, &awake, (long long){ASLEEP}, false,
                                                                          __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE)) return;
{_PAUSE}
    }}
"""

_POST = f"""
    typedef void (*Kernel)(void*, void*);
    long long* job = (long long*)address;
    long long* helpers = job + {OWN_WORDS};
    if (job[1] == 0) {{
        for (long long k = 0; k < job[0]; ++k) {{
            long long awake = {AWAKE};
            if (!__atomic_compare_exchange_n((long long*)helpers[{HELPER_WORDS} * k], &awake, (long long){CLAIMED}, false,
                                             __ATOMIC_ACQ_REL, __ATOMIC_ACQUIRE)) {{
                while (k-- > 0)
                    __atomic_store_n((long long*)helpers[{HELPER_WORDS} * k], (long long){AWAKE}, __ATOMIC_RELEASE);
                job[2] = {NOBODY};
                return;
            }}
        }}
        for (long long k = 0; k < job[0]; ++k) {{
            long long* state = (long long*)helpers[{HELPER_WORDS} * k];
            state[1] = job[3];
            state[2] = helpers[{HELPER_WORDS} * k + 1];
            state[3] = helpers[{HELPER_WORDS} * k + 2];
            __atomic_store_n(state, (long long){POSTED}, __ATOMIC_RELEASE);
        }}
        ((Kernel)job[3])((void*)job[4], (void*)job[5]);
    }}
    long long left = patience;
    for (long long k = 0; k < job[0]; ++k) {{
        while (__atomic_load_n((long long*)helpers[{HELPER_WORDS} * k], __ATOMIC_ACQUIRE) == {POSTED}) {{
            if (left-- <= 0) {{
                job[2] = {WAITING};
                return;
            }}
{_PAUSE}
        }}
    }}
    job[2] = {DONE};
"""


@functools.cache
def make_handover() -> tuple[Any, Any]:
    """Return the kernels (serve, post) of one index, for CPU devices alone.

    `serve` is what a helper runs. It watches its box of four words, state, kernel, bounds and arguments (addresses); runs
    what is posted there; and returns when nothing was for `patience` turns, or when it is called.

    `post` is what the calling thread runs. A job has the words number of helpers, phase, result, kernel, own bounds, own
    arguments, then box, bounds and arguments of each helper. In phase 0 it posts the kernel to all helpers and runs its own
    part, or leaves all as it was and says NOBODY if one of them sleeps. Then, and in phase 1 alone, it waits until the
    helpers are done, or says WAITING after `patience` turns.
    """

    @wp.func_native(_SERVE)
    def serve_box(box: wp.uint64, patience: wp.int64): ...

    @wp.func_native(_POST)
    def post_job(address: wp.uint64, patience: wp.int64): ...

    @wp.kernel(module="unique", enable_backward=False)
    def serve(box: wp.uint64, patience: wp.int64):
        serve_box(box, patience)

    @wp.kernel(module="unique", enable_backward=False)
    def post(address: wp.uint64, patience: wp.int64):
        post_job(address, patience)

    return serve, post
