"""The safety core: its sources, the tests that concern it, and builds in which its sources are compiled otherwise."""

import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
HERE = pathlib.Path(__file__).resolve().parent

# What decides whether a robot may move, and has it stop. Headers beside the sources belong to them. Left out: policies of
# loops, which watch and decide nothing; markers of executors, which draw; entry points of plugins.
SOURCES = {
    "framework/src/runtime": """
        replanner replanner_aside replanner_departure replanner_map replanner_settings replanner_stop plan_search
        reach_check shape_check truth_check head_guard step_watch predict checked_robot localised_executor""",
    "framework/src/planning": """
        validity_check field_check motion_check prediction_check clearance_prover edge_prover motion_bounds""",
    "framework/src/certificates": "body certificate certify leave_certificate parted_motion polynomial_motion",
    "framework/src/shapes": "shape_collider shape_motion shape_paths voxel_boxes",
    "framework/src/trajectory": "braking",
    "plugins/executors/simulated": "drift simulated_executor simulated_robot",
    "plugins/executors/ros1": "base_drive commands goals motion_checks options robot_link ros1_executor",
}

# Programs of tests, and which of their cases concern the core. The cases of ros_deployment_test are judged by the wall's
# clock: alone, and only where asked for.
TESTS = {
    "replanner_test": "*",
    "runtime_checks_test": "*",
    "planning_checks_test": "*",
    "trajectory_test": "*",
    "certify_test": "*",
    "robot_test": "HsrsHeadGuard*:HsrsGazeLoop*",
    "simulated_executor_test": "*",
    "ros1_executor_test": "*",
    "predictor_faults_test": "*",
}


def sources():
    """The sources of the core, relative to the root."""
    return [f"{folder}/{name}.cpp" for folder, names in SOURCES.items() for name in names.split()]


def files():
    """The sources of the core and the headers beside them."""
    headers = [str(pathlib.Path(source).with_suffix(".hpp")) for source in sources()]
    headers += ["framework/src/runtime/replanner_impl.hpp", "framework/src/certificates/polynomials.hpp",
                "framework/src/planning/cubic_motion.hpp"]
    return sources() + [header for header in headers if (ROOT / header).exists()]


def configure(build, mode, link_flags=""):
    """Configures a build in which core_compiler.py compiles the sources of the core, each alone; the rest is that of the
    release."""
    (build / "core").mkdir(parents=True, exist_ok=True)
    (build / "core" / "alone.cmake").write_text(f"add_compile_options(-fmacro-prefix-map={ROOT}/=)\n" + "".join(
        f"cmake_language(DEFER CALL set_source_files_properties {ROOT / source} DIRECTORY {ROOT / source.rsplit('/', 1)[0]}\n"
        f"  PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)\n" for source in sources()))
    launcher = f"{sys.executable};{HERE / 'core_compiler.py'};{mode};{build}"
    subprocess.run(
        ["cmake", "-S", ROOT, "-B", build, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_UNITY_BUILD=ON",
         "-DSIDESTEP_BENCHMARKS=OFF", "-DCMAKE_EXPORT_COMPILE_COMMANDS=ON", f"-DCMAKE_CXX_COMPILER_LAUNCHER={launcher}",
         f"-DCMAKE_PROJECT_INCLUDE={build / 'core' / 'alone.cmake'}",
         *(f"-DCMAKE_{kind}_LINKER_FLAGS={link_flags}" for kind in ("EXE", "SHARED", "MODULE"))],
        check=True, stdout=subprocess.DEVNULL)


def make(build, targets, jobs):
    subprocess.run(["ninja", "-C", build, f"-j{jobs}", *targets], check=True, stdout=sys.stderr)


def run_niced(words, **options):
    """Runs a command so that others who compute come first."""
    return subprocess.run(words, preexec_fn=lambda: os.nice(10), **options)
