# SPDX-License-Identifier: Apache-2.0
"""The subcommands of ``gdfe``, one module each: ``add_arguments(parser)`` and ``run(arguments) -> exit status``."""
