#!/usr/bin/env python3
"""The short benchmark: mapping drive and first legs of the BRIN building's first run.

usage: quick_benchmark.py BRIN_BENCHMARK WORLDS_FOLDER
"""
import json
import os
import subprocess
import sys
import tempfile


def main():
    program, worlds = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([program, "--quick", "--world", os.path.join(worlds, "brin_building.yaml"),
                        "--changes", os.path.join(worlds, "brin_changes.yaml"), "--out", folder], check=True)
        with open(os.path.join(folder, "report.json"), encoding="utf-8") as file:
            report = json.load(file)
    shown = ("legs", "failures", "collisions", "positioning_error_mean_m", "average_speed_mps")
    print({key: report[key] for key in shown})
    good = (report["legs"] == 4 and report["failures"] == 0 and report["collisions"] == 0 and
            report["positioning_error_mean_m"] <= 0.08 and report["average_speed_mps"] >= 0.40)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
