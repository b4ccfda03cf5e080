# SPDX-License-Identifier: Apache-2.0
"""Pages and pictures; all of them need Matplotlib, the extra ``plot``."""

from ros_pad.errors import ConfigError

try:
    import matplotlib.figure  # noqa: F401  # fails where NumPy is too new for it, too
except ImportError as error:
    raise ConfigError(
        f"pages and pictures need Matplotlib ({error}): pip install 'ros_pad[plot]', or for"
        " pad explore 'ros_pad[explore]'"
    ) from error
