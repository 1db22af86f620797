# SPDX-License-Identifier: GPL-3.0-or-later
"""The clips of a batch: finding them, capturing one of them, and the processes in which that
happens.
"""
