#!/usr/bin/env bash
# Installs what is missing, builds Sidestep, and makes Debian packages of it in build/packages: sidestep, libsidestep1,
# libsidestep-dev, sidestep-plugins, sidestep-plugins-ros1 and python3-sidestep.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
tools/install_deps.sh --packages
tools/build.sh release sidestep_product
cpack --config build/release/CPackConfig.cmake -B build/packages >build/packages.log || { cat build/packages.log >&2; exit 1; }
ls build/packages/*.deb
