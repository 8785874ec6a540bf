"""Fails where a dependency's licence is not one that Tyndall may be distributed with. Reads `cargo metadata` from standard input."""

import json
import re
import sys

ALLOWED = {
    "MIT", "Apache-2.0", "Apache-2.0 WITH LLVM-exception", "BSD-2-Clause", "BSD-3-Clause", "ISC", "Zlib",
    "Unicode-3.0", "IJG", "bzip2-1.0.6", "0BSD", "BSL-1.0", "Unlicense", "CC0-1.0", "MIT-0",
}


def allowed(expression: str) -> bool:
    """Whether one alternative of an SPDX expression has only allowed licences."""
    text = expression.replace("/", " OR ").replace("(", " ").replace(")", " ")
    return any(
        all(part.strip() in ALLOWED for part in re.split(r"\bAND\b", alternative))
        for alternative in re.split(r"\bOR\b", text)
    )


assert allowed("MIT OR GPL-3.0") and not allowed("GPL-3.0") and not allowed("MIT AND GPL-3.0")
packages = json.load(sys.stdin)["packages"]
bad = [(p["name"], p["license"]) for p in packages if not allowed(p["license"] or "")]
print(f"{len(packages)} packages, {len(bad)} with a licence that is not allowed")
for name, licence in bad:
    print(f"  {name}: {licence}")
sys.exit(bool(bad))
