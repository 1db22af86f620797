# SPDX-License-Identifier: GPL-3.0-or-later
"""The README's pictures: captured bodies on a bare floor, beside the truth where there is one, without the footage."""
