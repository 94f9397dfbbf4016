"""The numbers that docs/explanation/ready-studies.md says below the figures, read off the runs.

`python tools/study_numbers.py results/noise ...` prints the numbers of the ready studies that were
made in these folders, a line each: a statistic, of a column of runs.parquet, over the runs that a
query selects. So nothing is read off bins. Columns have the names of study-files.md without the
component and with _ for what is no letter; `peak` is the largest of the three peak commands, and
`final_error` of the three final errors.

============  =================================================================================
`n`           how many runs
`median`      and `min`, `max`: of the column
`share`       of the runs of which the column is true [%], and its exact interval of 95 % (Clopper
              and Pearson), as though the runs were independent
`bound`       what the share stays below, at 95 %, where of no run the column is true [%]
`rank`        Spearman's correlation of two columns, and its standard error; it sees no U shapes
============  =================================================================================

It needs pandas: the extra `docs`.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import pandas as pd
from scipy.stats import binomtest, spearmanr

from orchestrator.studies.study_result import StudyResult

#: Columns that are made of others, by study, in the language of pandas.
_MADE = {
    "attraction": {
        "speed": "sqrt(nu0_u**2 + nu0_v**2 + nu0_w**2)",
        "turn": "sqrt(nu0_p**2 + nu0_q**2 + nu0_r**2)",
        "way": "sqrt(eta0_x**2 + eta0_y**2 + eta0_z**2)",
        # What 80 N and 80 N·m keep up against the damping of 30 kg/s and 20 kg·m²/s.
        "physical": "speed < 80 / 30 and turn < 80 / 20",
    },
    "distance": {"way": "eta0_z"},
    "formation": {
        "close": "smallest_distance < 2",
        "leader_saturates": "auv1_saturated_fraction_u > 0",
        "follower_saturates": "auv2_saturated_fraction_u + auv3_saturated_fraction_u > 0",
        "good": "A_d < 5 and latency < 2 and loss < 0.5",
    },
    "noise": {"product": "k_d * noise_std", "gain": "estimate_error / product"},
    "robustness": {
        "ratio_of_fig_7": "omega_d == 0.1 and abs(A_d - 2 * A_f) < 1e-9",
        "chattering": "ratio_of_fig_7 and 6 < A_f < 22",
    },
    "sampling": {"product": "k_d * step"},
}

#: What column names begin with that tells nothing apart.
_COMPONENT = re.compile(r"^(auv\*\.)?(plant|controller|disturbance|link)\.")

#: The lines of each study, in the order of its text.
_LINES = {
    "attraction": """
        n by noise_std | proposed and h_max == 0.002
        n by noise_std | proposed and h_max == 0.002 and physical
        share failed by noise_std | h_max == 0.002
        max late_error by scenario noise_std | h_max == 0.002
        bound lost by noise_std | proposed and h_max == 0.002
        n by scenario noise_std | h_max == 0.02 and failed
        min speed by noise_std | failed
        min turn by noise_std | failed
        share saturated by scenario noise_std | h_max == 0.002 and physical
        median saturated_fraction_u by scenario noise_std | h_max == 0.002 and physical
        median peak_command_u by scenario noise_std | h_max == 0.002 and physical
        median peak_command_u by scenario noise_std | h_max == 0.002 and physical and way > 70
        median time_to_reach by scenario noise_std | h_max == 0.002 and physical and 45 < way < 55
        median late_error by scenario noise_std | h_max == 0.002 and physical and 45 < way < 55
    """,
    "distance": """
        n by scenario step noise_std
        max peak_command_u by step noise_std | proposed
        max peak_command_q by step noise_std | proposed
        max peak_command_r by step noise_std | proposed
        bound saturated by noise_std | proposed and step == 0.02
        bound saturated by noise_std | proposed and step == 0.005
        min way by step noise_std | proposed and saturated
        max way by step noise_std | proposed and not saturated
        median peak_command_u by step noise_std | proposed and 30 / 1.1 < way < 30 * 1.1
        median peak_command_u by step noise_std | proposed and 100 / 1.1 < way < 100 * 1.1
        median peak_command_u by step noise_std | proposed and 1e3 / 1.1 < way < 1e3 * 1.1
        min peak_command_u by step noise_std | PD
        median peak_command_u by step noise_std | PD and 30 / 1.1 < way < 30 * 1.1
        median peak_command_u by step noise_std | PD and 100 / 1.1 < way < 100 * 1.1
        median peak_command_u by step noise_std | PD and 1e3 / 1.1 < way < 1e3 * 1.1
        min saturated_fraction_u by step noise_std | PD and way > 300
        median time_to_reach by scenario step noise_std | 100 / 1.1 < way < 100 * 1.1
        min effort_ratio by step noise_std | PD and way > 100
        max effort_ratio by step noise_std | PD and way > 100
        median final_error by scenario step noise_std | 100 / 1.1 < way < 100 * 1.1
    """,
    "formation": """
        n
        n | failed
        min smallest_distance
        min smallest_distance | good
        share leader_saturates
        share follower_saturates
        share follower_saturates | good
        share close | A_d > 10
        rank smallest_distance latency
        rank smallest_distance loss
        rank smallest_distance A_d
    """,
    "gains": """
        n by scenario
        median late_error by scenario | 0.5 / 1.1 < lam < 0.5 * 1.1
        median late_error by scenario | 1 / 1.1 < lam < 1.1
        median late_error by scenario | 2 / 1.1 < lam < 2 * 1.1
        median late_error by scenario | 4 / 1.1 < lam < 4 * 1.1
        median peak_command_u by scenario | 0.5 / 1.1 < lam < 0.5 * 1.1
        median peak_command_u by scenario | 1 / 1.1 < lam < 1.1
        median peak_command_u by scenario | 2 / 1.1 < lam < 2 * 1.1
        median peak_command_u by scenario | 4 / 1.1 < lam < 4 * 1.1
        share saturated | proposed and lam > 2
        min peak | proposed and lam > 2
        median late_error by tenth_eps_t | proposed
        median late_error by tenth_sigma | proposed
        median late_error by tenth_gamma | proposed
        median late_error by tenth_k_d | proposed
        median late_error by tenth_K2_1 | proposed
        median late_error by tenth_K2_2 | proposed
        median late_error by tenth_K2_3 | proposed
    """,
    "noise": """
        median gain | proposed and noise_std < 0.003
        max product | proposed and not saturated
        min product | proposed and saturated
        min noise_std | proposed and saturated and 50 / 1.1 < k_d
        min noise_std | proposed and saturated and 20 / 1.1 < k_d < 20 * 1.1
        min noise_std | proposed and saturated and 5 / 1.1 < k_d < 5 * 1.1
        min noise_std | proposed and saturated and k_d < 2 * 1.1
        max noise_std | PD and not saturated
        min noise_std | PD and saturated
        median late_error | proposed and k_d < 5 and noise_std < 0.0002
        median late_error | proposed and k_d > 20 and noise_std < 0.0002
        median theta_hat_half_1 by scenario | 0.018 < noise_std < 0.022
        median theta_hat_end_1 by scenario | 0.018 < noise_std < 0.022
        median theta_hat_half_1 by scenario | noise_std < 0.0002
        median theta_hat_end_1 by scenario | noise_std < 0.0002
        share lost | proposed and k_d > 20 and 0.06 < noise_std
    """,
    "robustness": """
        n by noise_std
        share failed by noise_std
        max A_f by scenario omega_d noise_std | step == 0.02 and A_d == 1 and kept_f
        max A_f by scenario omega_d noise_std | step == 0.005 and A_d == 1 and kept_f
        max A_d by scenario omega_d noise_std | step == 0.02 and A_f == 0.5 and kept_d
        max A_d by scenario omega_d noise_std | step == 0.005 and A_f == 0.5 and kept_d
        max late_error by A_f step noise_std | proposed and ratio_of_fig_7 and A_f < 6
        min A_f by scenario step noise_std | ratio_of_fig_7 and lost
        max late_error by scenario step noise_std
        max total_variation_u by A_f scenario noise_std | step == 0.02 and chattering
        max total_variation_u by A_f scenario noise_std | step == 0.005 and chattering
    """,
    "sampling": """
        n
        median peak_command_u by observer | proposed and product < 1.9
        min product | proposed and observer == "euler" and peak_command_u > 45
        max product | proposed and observer == "euler" and peak_command_u < 45
        median estimate_error | proposed and observer == "exact" and product > 10
        median l2_effort_q by scenario | observer == "exact" and step < 0.0022
        median l2_effort_q by scenario | observer == "exact" and 0.019 < step < 0.021
        median l2_effort_q by scenario | observer == "exact" and step > 0.09
        min step | PD and total_variation_u > 1e5
    """,
}


def _share(column: pd.Series) -> str:
    hits, n = int(column.sum()), len(column)
    low, high = binomtest(hits, n).proportion_ci()
    return f"{hits} of {n}, {100 * hits / n:.3g} % ({100 * low:.3g} to {100 * high:.3g})"


def _bound(column: pd.Series) -> str:
    # The root of 0.05 = (1 - share)^n: the rule of three.
    return f"{column.sum()} of {len(column)}, {100 * (1 - 0.05 ** (1 / len(column))):.2g} %"


def _rank(one: pd.Series, other: pd.Series) -> str:
    return f"{spearmanr(one, other).statistic:.3f} ± {(len(one) - 1) ** -0.5:.3f} (n = {len(one)})"


#: The numbers that a line may ask for, from the columns that it names.
STATISTICS: Mapping[str, Callable[..., str]] = {
    "n": lambda column: str(len(column)),
    "median": lambda column: f"{column.median():.5g} (n = {len(column)})",
    "min": lambda column: f"{column.min():.5g}",
    "max": lambda column: f"{column.max():.5g}",
    "share": _share,
    "bound": _bound,
    "rank": _rank,
}


def prepared(study: str, runs: pd.DataFrame) -> pd.DataFrame:
    """The runs with short names, and with the columns that are made of others."""
    runs = runs.rename(columns=lambda name: _COMPONENT.sub("", name))
    runs = runs.rename(columns=lambda name: re.sub(r"\W+", "_", name).strip("_"))
    runs = runs.rename(columns={"lambda": "lam"})
    if "scenario" in runs:
        runs["proposed"], runs["PD"] = runs.scenario == "fig5", runs.scenario == "fig5-pd"
    runs["failed"] = runs.failure.fillna("") != ""
    # Of several vehicles, the largest.
    runs["late_error"] = runs.filter(regex="(^|_)late_error$").max(axis=1)
    runs["lost"] = ~(runs.late_error <= 1.0)
    runs["saturated"] = runs.filter(like="saturated_fraction").max(axis=1) > 0.0
    runs["peak"] = runs.filter(like="peak_command").max(axis=1)
    runs["final_error"] = runs.filter(like="final_error_").max(axis=1)
    for name, made in _MADE.get(study, {}).items():
        runs[name] = runs.eval(made)
    if study == "distance":
        # The proposed controller's run of a point comes first.
        proposed = runs.groupby(["step", "noise_std", "way"]).l2_effort_u.transform("first")
        runs["effort_ratio"] = runs.l2_effort_u / proposed
    for amplitude, other in (("A_f", "A_d"), ("A_d", "A_f")) if study == "robustness" else ():
        # Whether it is kept with this disturbance, and with all weaker ones on the line.
        line = runs.sort_values(amplitude).groupby(
            ["scenario", "step", "noise_std", "omega_d", other]
        )
        runs[f"kept_{amplitude[-1]}"] = ~line.lost.cummax()
    return runs


def lines_of(study: str) -> list[str]:
    """What is said of a study: `STATISTIC COLUMNS by COLUMNS | QUERY`."""
    return [line.strip() for line in _LINES[study].strip().splitlines()]


def parsed(line: str) -> tuple[str, list[str], list[str], str]:
    """The statistic of a line, its columns, what tells groups apart, and the query."""
    what, _, where = line.partition(" | ")
    names, by = (part.split() for part in what.partition(" by ")[::2])
    return names[0], names[1:] or ["run"], by, where


def said(line: str, runs: pd.DataFrame) -> str:
    """The numbers of a line."""
    statistic, columns, by, where = parsed(line)
    part = runs.query(where) if where else runs
    for tenth in (name for name in by if name.startswith("tenth_")):
        part = part.assign(**{tenth: pd.qcut(part[tenth.removeprefix("tenth_")], 10, labels=False)})
    groups = part.groupby(by) if by else [((), part)]
    found = []
    for key, group in groups:
        number = STATISTICS[statistic](*(group[name] for name in columns))
        found.append(" ".join((*map(_short, key), number)))
    return ", ".join(found)


def _short(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def main() -> None:
    """Print the numbers of the studies in some folders."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="+", type=Path)
    for folder in parser.parse_args().folder:
        result = StudyResult(folder)
        study = result.record["study"]
        runs = prepared(study, result.to_dataframe().reset_index())
        print(f"\n{study}")
        for line in lines_of(study):
            print(f"  {line}: {said(line, runs)}")


if __name__ == "__main__":
    main()
