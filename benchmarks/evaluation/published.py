# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures that others have published, each with the table that it is from.

Those of the solver's paper were transcribed from the paper. The others were transcribed from
summaries of their tables, and only those are listed for which one was found: look a figure up in
its paper before citing it. Others evaluate with SMPL and with networks
that were trained on the data sets' training splits; `docs/evaluation.md` says what differs.
"""

from __future__ import annotations

from dataclasses import dataclass, field

_HMR_P2 = (
    "Kanazawa et al., HMR, CVPR 2018, table of protocol 2; repeated by Arnab et al., CVPR 2019, "
    "table 2"
)
_GVHMR = "Shen et al., GVHMR, SIGGRAPH Asia 2024 (arXiv:2409.06662)"
_GVHMR_CAMERA = f"{_GVHMR}, table 2"
_GVHMR_WORLD = f"{_GVHMR}, table 1"
_HUMAN3R = "Chen et al., Human3R (arXiv:2510.06219), table of 3DPW and EMDB-1"
_ONLINE_CAMERA = "OnlineHMR, table of EMDB-1 (there PHMR, offline, is PromptHMR-Vid)"
_ONLINE_WORLD = "OnlineHMR, table of EMDB-2 (there PHMR, offline, is PromptHMR-Vid)"
_METRIC = "MetricHMSR, table of 3DPW"
_SAM3D = "Yang et al., SAM 3D Body (arXiv:2602.15989), main table of accuracy, ViT-H"
_HSMR = (
    "Xia et al., HSMR, CVPR 2025 (arXiv:2503.21751), table 1, which does not state the protocol of "
    "Human3.6M"
)
_VIBE_ISSUE = (
    "issue 151 of github.com/mkocabas/VIBE, which quotes VIBE's paper and could not reproduce its "
    "figures"
)
# The solver's paper; a method is named as there, with the year of its publication.
_SCOPE = "Fan et al., SCOPE, ICCV 2021"
_SCOPE_H36M = f"{_SCOPE}, table 1"
_SCOPE_3DHP = f"{_SCOPE}, table 2"
_SCOPE_3DPW = f"{_SCOPE}, table 3, which does not say to which root joints are relative"
_GENMO = "GENMO, ICCV 2025, table of EMDB-2; the same in Human3R"


@dataclass(frozen=True)
class Published:
    """A row: the method, its figures by key of `protocols.MEASURES`, and where they are stated."""

    method: str
    source: str
    figures: dict[str, float] = field(default_factory=dict)


def _mesh(
    pa_mpjpe: float, mpjpe: float, mpvpe: float, acceleration: float | None = None
) -> dict[str, float]:
    figures = {"mpjpe": mpjpe, "pa_mpjpe": pa_mpjpe, "mpvpe": mpvpe}
    return figures if acceleration is None else figures | {"acceleration": acceleration}


def _world(
    wa: float, w: float, rte: float, jitter: float | None = None, slide: float | None = None
) -> dict[str, float]:
    figures = {"wa_mpjpe": wa, "w_mpjpe": w, "rte": rte, "jitter": jitter, "foot_slide": slide}
    return {key: value for key, value in figures.items() if value is not None}


def _3dhp(pck: float, auc: float, mpjpe: float) -> dict[str, float]:
    return {"pck": pck, "auc": auc, "mpjpe": mpjpe}


def _3dhp_aligned(pck: float, auc: float, mpjpe: float) -> dict[str, float]:
    return {"pa_pck": pck, "pa_auc": auc, "pa_mpjpe": mpjpe}


PUBLISHED: dict[str, list[Published]] = {
    "h36m-p1": [
        Published("HMR", "Kanazawa et al., HMR, CVPR 2018, table of protocol 1", {"mpjpe": 88.0}),
        Published("Rogez et al. 2017", _SCOPE_H36M, {"mpjpe": 87.7, "pa_mpjpe": 71.6}),
        Published("Pavlakos et al. 2017", _SCOPE_H36M, {"mpjpe": 71.9, "pa_mpjpe": 51.2}),
        Published("Pavllo et al. 2019", _SCOPE_H36M, {"mpjpe": 51.8, "pa_mpjpe": 40.0}),
        Published("VNect", _SCOPE_H36M, {"mpjpe": 80.5}),
        Published("HMR", _SCOPE_H36M, {"mpjpe": 88.0, "pa_mpjpe": 58.1}),
        Published("Kolotouros et al. 2019", _SCOPE_H36M, {"mpjpe": 74.7, "pa_mpjpe": 51.9}),
        Published("SPIN", _SCOPE_H36M, {"mpjpe": 65.6, "pa_mpjpe": 44.6}),
        Published("MTC", _SCOPE_H36M, {"mpjpe": 64.5}),
        Published("SCOPE", _SCOPE_H36M, {"mpjpe": 61.5, "pa_mpjpe": 48.2}),
    ],
    "h36m-p2": [
        Published("Rogez et al. 2016", _SCOPE_H36M, {"pa_mpjpe": 87.3}),
        Published("Pavlakos et al. 2017", _SCOPE_H36M, {"pa_mpjpe": 51.9}),
        Published("Martinez et al. 2017", _SCOPE_H36M, {"pa_mpjpe": 47.7}),
        Published("Kolotouros et al. 2019", _SCOPE_H36M, {"pa_mpjpe": 50.1}),
        Published("SPIN", _SCOPE_H36M, {"pa_mpjpe": 41.1}),
        Published("UP-P91", _SCOPE_H36M, {"pa_mpjpe": 80.7}),
        Published(
            "SCOPE", f"{_SCOPE_H36M}; MPJPE: its section 5.4", {"mpjpe": 60.3, "pa_mpjpe": 46.3}
        ),
        Published("SMPLify", _HMR_P2, {"pa_mpjpe": 82.3}),
        Published("HMR", _HMR_P2, {"pa_mpjpe": 56.8}),
        Published(
            "VIBE",
            "Kocabas et al., VIBE, CVPR 2020, table of Human3.6M",
            {"mpjpe": 65.6, "pa_mpjpe": 41.4},
        ),
        Published(
            "HMR 2.0a (4DHumans)",
            "Goel et al., Humans in 4D, ICCV 2023 (arXiv:2305.20091), table of 3DPW and Human3.6M",
            {"mpjpe": 44.8, "pa_mpjpe": 33.6},
        ),
        Published("PARE", _HSMR, {"mpjpe": 76.8, "pa_mpjpe": 50.6}),
        Published("HybrIK", _HSMR, {"mpjpe": 54.4, "pa_mpjpe": 34.5}),
        Published("CLIFF", _HSMR, {"mpjpe": 47.1, "pa_mpjpe": 32.7}),
        Published("PLIKS", _HSMR, {"mpjpe": 47.0, "pa_mpjpe": 34.5}),
        Published("HMR 2.0 (4DHumans)", _HSMR, {"mpjpe": 50.0, "pa_mpjpe": 32.4}),
        Published("HSMR", _HSMR, {"mpjpe": 50.4, "pa_mpjpe": 32.9}),
    ],
    "3dhp": [
        Published("Mehta et al. 2017", _SCOPE_3DHP, _3dhp(75.7, 39.3, 117.6)),
        Published("HMR", _SCOPE_3DHP, _3dhp(72.9, 36.5, 124.2) | _3dhp_aligned(86.3, 47.8, 89.8)),
        Published("SPIN", _SCOPE_3DHP, _3dhp(76.4, 37.1, 105.2) | _3dhp_aligned(92.5, 55.6, 67.5)),
        Published("XNect", _SCOPE_3DHP, _3dhp(77.8, 38.9, 115.0)),
        Published("VNect", _SCOPE_3DHP, _3dhp(76.6, 40.4, 124.7) | _3dhp_aligned(83.9, 47.3, 98.0)),
        Published("SCOPE", _SCOPE_3DHP, _3dhp(83.0, 41.9, 91.5) | _3dhp_aligned(94.6, 59.0, 62.1)),
        Published("SPIN", _VIBE_ISSUE, {"pck": 76.4}),
        Published("VIBE", _VIBE_ISSUE, {"pck": 89.0, "mpjpe": 97.7, "pa_mpjpe": 63.4}),
        Published(
            "OriNet",
            "Luo et al., OriNet, BMVC 2018, its repository's table for the corrected test set",
            {"pck": 84.3, "auc": 47.5, "mpjpe": 84.5},
        ),
    ],
    "3dpw-mesh": [
        Published("HMR", _SCOPE_3DPW, {"mpjpe": 130.0, "pa_mpjpe": 81.3}),
        Published("Kolotouros et al. 2019", _SCOPE_3DPW, {"pa_mpjpe": 70.2}),
        Published("Arnab et al. 2019", _SCOPE_3DPW, {"pa_mpjpe": 72.2}),
        Published("Kanazawa et al. 2019", _SCOPE_3DPW, {"mpjpe": 116.5, "pa_mpjpe": 72.6}),
        Published("XNect", _SCOPE_3DPW, {"mpjpe": 134.2, "pa_mpjpe": 80.3}),
        Published("SCOPE", _SCOPE_3DPW, {"mpjpe": 98.6, "pa_mpjpe": 68.0}),
        Published(
            "SPIN",
            "Kolotouros et al., SPIN, ICCV 2019, table of 3DPW; the same in table 3 of SCOPE",
            {"mpjpe": 96.9, "pa_mpjpe": 59.2},
        ),
        Published("HMR 2.0a (4DHumans)", _GVHMR_CAMERA, _mesh(44.4, 69.8, 82.2, 18.1)),
        Published("WHAM", _GVHMR_CAMERA, _mesh(35.9, 57.8, 68.7, 6.6)),
        Published("TRAM", _METRIC, _mesh(35.6, 59.3, 69.6)),
        Published("GVHMR", _GVHMR_CAMERA, _mesh(36.2, 55.6, 67.2, 5.0)),
        Published("PromptHMR", _HUMAN3R, _mesh(36.6, 58.7, 69.4)),
        Published("PromptHMR-Vid", f"{_METRIC} (there PromptHMR)", _mesh(35.5, 56.9, 67.3)),
        Published("SAM 3D Body", _SAM3D, {"pa_mpjpe": 33.2}),
    ],
    "emdb1": [
        Published("HMR 2.0 (4DHumans)", _ONLINE_CAMERA, _mesh(60.7, 98.3, 120.8, 19.9)),
        Published("WHAM", _GVHMR_CAMERA, {"pa_mpjpe": 50.4}),
        Published("TRAM", _ONLINE_CAMERA, _mesh(45.7, 74.4, 86.6, 4.9)),
        Published("GVHMR", _GVHMR_CAMERA, {"pa_mpjpe": 42.7}),
        Published("GVHMR, as others evaluated it", _ONLINE_CAMERA, _mesh(44.5, 74.2, 85.9)),
        Published("PromptHMR", _HUMAN3R, _mesh(41.0, 71.7, 84.5)),
        Published("PromptHMR-Vid", _ONLINE_CAMERA, _mesh(40.1, 68.1, 79.2)),
        Published("SAM 3D Body", _SAM3D, {"mpjpe": 62.9, "mpvpe": 74.3}),
    ],
    "emdb2": [
        Published("WHAM (DPVO)", _GVHMR_WORLD, _world(135.6, 354.8, 6.0, 22.5, 4.4)),
        Published("GVHMR (DPVO)", _GVHMR_WORLD, _world(111.0, 276.5, 2.0, 16.7, 3.5)),
        Published("TRAM", _GENMO, _world(76.4, 222.4, 1.4)),
        Published("PromptHMR-Vid", _ONLINE_WORLD, _world(71.0, 216.5, 1.3)),
    ],
    "rich": [
        Published("HMR 2.0 (4DHumans)", _GVHMR_CAMERA, {"mpjpe": 96.0}),
        Published(
            "WHAM",
            f"{_GVHMR}, tables 1 and 2",
            {"mpjpe": 80.0} | _world(109.9, 184.6, 4.1, 19.7, 3.3),
        ),
        Published(
            "GVHMR",
            f"{_GVHMR}, tables 1 and 2",
            {"mpjpe": 66.0} | _world(78.8, 126.3, 2.4, 12.8, 3.0),
        ),
        Published("PromptHMR", _SAM3D, {"pa_mpjpe": 37.3}),
        Published("SAM 3D Body", _SAM3D, {"pa_mpjpe": 31.9}),
    ],
}
