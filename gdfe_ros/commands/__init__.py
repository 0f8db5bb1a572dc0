# SPDX-License-Identifier: Apache-2.0
"""The subcommands of ``gdfe``.

The module of one command has ``add_arguments(parser)`` and ``run(arguments) -> exit status``. A module of several has
such pairs of functions in ``COMMANDS``.
"""
