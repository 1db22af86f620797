# SPDX-License-Identifier: GPL-3.0-or-later
"""Scope on the public data sets: `./scripts/evaluate DATASET FOLDER`; the data are the user's.

readers/          one file for each data set: its folders and files -> clips with ground truth
files.py          reading files that may be missing, damaged or hostile
clips.py          footage, people and their ground truth, as the readers give them
models.py         the user's SMPL and SMPL-X files, by which data sets state ground truth
subjects.py       points of a person over time: measured joints, or a posed body
joint_sets.py     the joints that are compared, by name, and where they are on a body
metrics.py        the measures, as equations
protocols.py      which joints, which alignment and which measures make a protocol
run.py            captures the clips; an interrupted run goes on
scores.py         the figures of captured clips
published.py      figures of others, each with its source
__main__.py       the command line, and the table
"""
