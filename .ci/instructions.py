#!/usr/bin/env python3
"""Counts the instructions of small cases and compares them with those recorded: a regression without the noise of times.

    python3 .ci/instructions.py            # fails where a case takes over 5 % more than recorded
    python3 .ci/instructions.py --record   # writes the counts to benches/instructions.txt

The cases are those of `crates/tyndall/benches/instructions.rs`; Valgrind counts. It knows no AVX-512, so that the kernels take
their AVX2 form. They are built without optimisation over crates, which would take minutes. Without Valgrind or AVX2 this says
that it was skipped. Counts depend on the compiler: beside those of another version ratios are told, and nothing fails.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RECORD = ROOT / "benches/instructions.txt"
MOST = 1.05
# Fewer than so many are worth being recorded.
LEAST = 0.95


def main():
    if reason := unable():
        print(f"skipped: {reason}")
        return
    program = build()
    names = output([program, "--list"]).split()
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        counts = dict(zip(names, threads.map(lambda name: count(program, name), names)))
    compiler = output(["rustc", "--version"]).strip()
    if "--record" in sys.argv[1:]:
        lines = [f"{name}\t{number}\n" for name, number in counts.items()]
        about = "# Instructions of crates/tyndall/benches/instructions.rs, by `python3 .ci/instructions.py --record`.\n"
        RECORD.write_text(f"{about}# {compiler}\n{''.join(lines)}")
        print(f"recorded {len(counts)} counts")
        return
    sys.exit(compare(counts, compiler))


def unable():
    """Why nothing can be counted here, if so."""
    if not shutil.which("valgrind"):
        return "no valgrind"
    cpu = Path("/proc/cpuinfo")
    if not cpu.exists() or " avx2 " not in cpu.read_text():
        return "no processor with AVX2, for which the counts are recorded"
    return None


def output(command):
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, cwd=ROOT).stdout


def build():
    """Builds the cases as benches are built; where the program is."""
    command = ["cargo", "bench", "--workspace", "--bench", "instructions", "--no-run", "--message-format=json"]
    messages = (json.loads(line) for line in output(command).splitlines())
    return next(it["executable"] for it in messages if it.get("executable"))


def count(program, name):
    """Instructions that a case takes inside `measured`."""
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", "--toggle-collect=*instructions::measured*"]
    done = subprocess.run([*command, program, name], stderr=subprocess.PIPE, text=True, cwd=ROOT)
    collected = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode != 0 or not collected or int(collected[1]) == 0:
        sys.exit(f"error: {name} could not be counted\n{done.stderr}")
    return int(collected[1])


def compare(counts, compiler):
    """Prints each case beside what is recorded; the exit code."""
    text = RECORD.read_text()
    recorded = {name: int(number) for name, number in re.findall(r"^([^#\s]+)\t(\d+)$", text, re.MULTILINE)}
    worse, better = [], []
    print(f"{'case':<32} {'recorded':>14} {'now':>14}  ratio")
    for name in recorded | counts:
        before, now = recorded.get(name), counts.get(name)
        ratio = now / before if before and now else None
        worse += [name] if ratio is None or ratio > MOST else []
        better += [name] if ratio is not None and ratio < LEAST else []
        print(f"{name:<32} {before or '–':>14} {now or '–':>14}  {f'{ratio:.3f}' if ratio else '–'}")
    anew = "python3 .ci/instructions.py --record"
    if compiler not in text:
        print(f"recorded with another compiler than {compiler}: nothing fails; to record anew: {anew}")
        return 0
    if better:
        print(f"fewer than recorded: {', '.join(better)}; to keep that: {anew}")
    if worse:
        print(f"more than {MOST} of what is recorded, or on one side only: {', '.join(worse)}; if that is right: {anew}")
    return 1 if worse else 0


if __name__ == "__main__":
    main()
