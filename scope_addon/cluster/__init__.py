# SPDX-License-Identifier: GPL-3.0-or-later
"""The clips of a batch on the machines of a Dask cluster; nothing else imports `distributed`. Not
in the extension.

This machine gives each clip to a worker, and checks and publishes the results. A worker captures
into a folder of the attempt, below the output folder, in a process of its own:

    waiting  ->  attempt on a worker  ->  checked against the worker's hashes  ->  renamed
       ^                 |
       +---- worker lost, content differs (three times: failed)
"""
