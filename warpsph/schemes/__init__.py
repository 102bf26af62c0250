"""Schemes: each file lists the stages of one time step, in order, with the reason for each."""
