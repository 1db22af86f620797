# SPDX-License-Identifier: GPL-3.0-or-later
"""Feet and palms that stay where they rest, without looking ahead."""
