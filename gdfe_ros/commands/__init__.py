# SPDX-License-Identifier: Apache-2.0
"""The subcommands of ``gdfe``.

The module of one command has ``add_arguments(parser)`` and ``run(arguments) -> exit status``. The module of several
commands has a dict ``COMMANDS`` from command to such a pair of functions.
"""
