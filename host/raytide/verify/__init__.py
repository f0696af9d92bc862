"""Numerical cases that a device must hold: data, a small function each, and oracles that are not raytide."""

from raytide.verify.case import CASES, GROUPS, Case, Trial, Verdict
from raytide.verify.run import chosen_cases, judge_case, replay, run_cases

__all__ = ["CASES", "GROUPS", "Case", "Trial", "Verdict", "chosen_cases", "judge_case", "replay", "run_cases"]
