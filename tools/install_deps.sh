#!/usr/bin/env bash
# Installs, with apt, the Debian 12 packages that building, testing and running Sidestep needs.
# Does nothing when all are there. Uses sudo when not root.
#
#   tools/install_deps.sh             what building, testing and running need
#   tools/install_deps.sh --packages  also ROS 1 for the plugins that speak it, what the Python module needs, and
#                                     help2man, with which manual pages are written
#   tools/install_deps.sh --dev       also clang-format, clang-tidy, Slurm, and what some tests hold results against
set -euo pipefail

packages=(
  # build
  build-essential cmake ninja-build ccache pkg-config git ca-certificates
  # the SDK
  libeigen3-dev libexpected-dev libtbb-dev libembree-dev
  # the host and the command
  libyaml-cpp-dev libsqlite3-dev libcli11-dev libspdlog-dev libfmt-dev nlohmann-json3-dev libfcl-dev
  # the viewer's server
  libboost-dev
  # pictures
  libcairo2-dev fontconfig fonts-dejavu-core
  # plugins
  libpng-dev liboctomap-dev libdynamicedt3d-dev liburdfdom-dev liburdfdom-headers-dev
  libceres-dev libompl-dev libpcl-dev
  # tests and benchmarks
  libgtest-dev libgmock-dev libbenchmark-dev sqlite3
)
# the viewer's page and tests/net; a Node that comes from elsewhere brings an npm of its own
command -v node >/dev/null || packages+=(nodejs)
command -v npm >/dev/null || packages+=(npm)
case "${1:-}" in
  "") ;;
  --packages | --dev)
    # ROS 1, for source rosbag; for source and executor ros1 and tools/fake_hsr
    packages+=(libroscpp-core-dev libsensor-msgs-dev libnav-msgs-dev libtf2-msgs-dev libbz2-dev liblz4-dev
      libroscpp-dev libtrajectory-msgs-dev libvisualization-msgs-dev libactionlib-msgs-dev)
    # the Python module
    packages+=(python3-dev pybind11-dev python3-numpy)
    packages+=(help2man)  # manual pages
    packages+=(file)  # with which cpack tells what of a package is a program
    ;;
  *)
    echo "usage: tools/install_deps.sh [--packages | --dev]" >&2
    exit 2
    ;;
esac
if [ "${1:-}" = "--dev" ]; then
  packages+=(clang-format clang-tidy)
  packages+=(clang libclang-rt-14-dev)  # with which tools/fuzz.sh builds
  # the tests of ROS 1
  packages+=(librosbag-storage-dev python3-rosmaster python3-roslaunch python3-rostopic)
  packages+=(chromium fonts-inter)  # for the tests and pictures of the viewer's page
  packages+=(ompl-demos)  # ompl_benchmark_statistics, with which a test reads a benchmark's database
  # with which tests read recordings
  packages+=(python3-rosbag python3-std-msgs python3-sensor-msgs python3-tf2-msgs)
  packages+=(python3-visualization-msgs python3-trajectory-msgs python3-yaml)
  packages+=(slurm-wlm)  # with which a test has a cluster do a sweep
  packages+=(python3-sphinx furo python3-myst-parser python3-breathe doxygen)  # the site of the documentation
  packages+=(ffmpeg)  # its films
  packages+=(python3-pandas python3-matplotlib)  # what sidestep.results needs
  packages+=(lintian mmdebstrap)  # which check packages, and try them on a new root
fi

missing=()
for package in "${packages[@]}"; do
  state=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
  [ "$state" = installed ] || missing+=("$package")
done
if [ ${#missing[@]} -eq 0 ]; then
  exit 0
fi

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || {
    echo "install_deps.sh: run as root, or install sudo; missing: ${missing[*]}" >&2
    exit 1
  }
  as_root=(sudo)
fi

echo "Installing with apt: ${missing[*]}"
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
  apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
echo "Installed ${#missing[@]} packages."
