# SPDX-License-Identifier: GPL-3.0-or-later
"""What the commands of `cli` share: arguments made from the declared options, the terminal, signals, result files."""
