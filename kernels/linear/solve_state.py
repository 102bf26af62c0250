"""What passes between the kernels of a linear solve: entries of the float64 `solve_state` and the int32 `solve_flags`."""

import warp as wp

# entries of `solve_state`: what the caller sets
TOLERANCE = 0  # relative residual to reach
LIMIT = 1  # iterations at most
# what a solve leaves behind
ITERATIONS = 2
RESIDUAL = 3  # |b - A x| / |b|, evaluated, not from the recurrence
REASON = 4  # CONVERGED ...
RESTARTS = 5  # how often the recurrence was started again from the evaluated residual
# summed up over solves
SOLVES = 6
TOTAL_ITERATIONS = 7
WORST_RESIDUAL = 8
FAILURES = 9  # solves that did not reach the tolerance
WORST_ITERATIONS = 10
# what passes between the kernels of a solve
RHS2 = 11  # b.b
RESIDUAL2 = 12  # r.r of the recurrence
RHO = 13  # r.z (CG) or shadow.r (BiCGSTAB)
ALPHA = 14
BETA = 15
OMEGA = 16
LAST2 = 17  # r.r at the last evaluation
STRIKES = 18  # restarts in a row that gained nothing
GOAL2 = 19  # r.r at which the recurrence stops
RHS_MEAN = 20
SOLUTION_MEAN = 21
FRESH = 22  # 1: the next iteration begins a recurrence
SHADOW2 = 23  # shadow.shadow
ROWS = 24  # rows that have entries
RESIDUAL_MEAN = 25  # of r over them, rounding alone: 0 unless singular
SINGULAR = 26  # 1: the constant over these rows is a null vector
PEAK2 = 27  # largest r.r since the last evaluation
REPLACING = 28  # 1: the recurrence goes on from the residual that is evaluated next
SCALED_MEAN = 29  # of the preconditioned residual over the same rows: no part of the solution of a singular system
STATE_SIZE = 30

# entries of `solve_flags`
ACTIVE = 0  # the solve goes on
RUNNING = 1  # the recurrence goes on
FLAGS_SIZE = 2

# values of REASON
CONVERGED = 0
OUT_OF_ITERATIONS = 1
STALLED = 2
NOT_FINITE = 3

# numbers of the type of `solve_state`, for kernels
ZERO, ONE = wp.constant(wp.float64(0.0)), wp.constant(wp.float64(1.0))
