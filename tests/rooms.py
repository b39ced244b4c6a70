"""Tests and their helpers import each other by name, whatever their room: `import rooms` comes first."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent

sys.path[:0] = [str(HERE), *(str(each) for each in sorted(HERE.iterdir()) if any(each.glob("test_*.py")))]
