#!/usr/bin/env bash
# Inside a root of its own, beside the packages: installs them, tries what is in them, and removes them.
#
#   try_packages.sh apt|dpkg
set -euo pipefail
with=$1
cd "$(dirname "${BASH_SOURCE[0]}")"
export DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8
unset SIDESTEP_PLUGIN_PATH LD_LIBRARY_PATH PYTHONPATH
trial=$(mktemp -d)

say() { printf '%s\n' "$*"; }
try() { # try NAME COMMAND...
  local name=$1 code=0
  shift
  set +e
  (set -e; "$@") >"$trial/log" 2>&1
  code=$?
  set -e
  [ $code -eq 0 ] || { cat "$trial/log"; say "$name: failed"; exit 1; }
  say "$name: passed"
}
is_one_of() { grep -qxF -- "$1" || { say "no '$1'"; return 1; }; }

names=$(for deb in *.deb; do dpkg-deb -f "$deb" Package; done)
if [ "$with" = apt ]; then
  try install apt-get install -y --no-install-recommends ./*.deb
else
  try install dpkg -i ./*.deb
fi

demo() {
  cd "$trial"
  sidestep run demo --out demo
  grep -q '"success": true' demo/summary.json
}
try "the demo" demo

template() {
  cd "$trial"
  sidestep new mapper my_mapper
  cmake -S my_mapper -B my_mapper/build
  cmake --build my_mapper/build
  ctest --test-dir my_mapper/build --no-tests=error --output-on-failure
}
try "a plugin of one's own" template

with_pkg_config() {
  # shellcheck disable=SC2046
  g++ -std=c++20 embed.cpp -o "$trial/embed" $(pkg-config --cflags --libs sidestep)
  "$trial/embed"
}
try "a program of one's own" with_pkg_config

in_python() { /usr/bin/python3 -c "
import sidestep
session = sidestep.Session()
session.planner(session.robot('hsr'), 'gp_chain', sampler='rrt_connect')
"; }
try "Python" in_python

manual() { zcat /usr/share/man/man1/sidestep.1.gz /usr/share/man/man1/sidestep-run.1.gz | grep -c '^\.TH "\?SIDESTEP'; }
try "the manual" manual

completion() {
  . /usr/share/bash-completion/completions/sidestep
  COMP_WORDS=(sidestep swe) COMP_CWORD=1
  _sidestep && printf '%s\n' "${COMPREPLY[@]}" | is_one_of sweep
  COMP_WORDS=(sidestep run --res) COMP_CWORD=2
  _sidestep && printf '%s\n' "${COMPREPLY[@]}" | is_one_of --resume
  COMP_WORDS=(sidestep run kitchen) COMP_CWORD=2
  _sidestep && printf '%s\n' "${COMPREPLY[@]}" | is_one_of kitchen_hsr_gp
  COMP_WORDS=(sidestep robot fet) COMP_CWORD=2
  _sidestep && printf '%s\n' "${COMPREPLY[@]}" | is_one_of fetch
  COMP_WORDS=(sidestep new exec) COMP_CWORD=2
  _sidestep && printf '%s\n' "${COMPREPLY[@]}" | is_one_of executor
}
try "completion" completion

# Who installs the ROS plugins later is told so.
dpkg --remove sidestep-plugins-ros1 >/dev/null
without_ros() {
  local code=0
  sidestep check ros1/hsr_deploy >"$trial/told" 2>&1 || code=$?
  [ $code -eq 3 ]
  grep 'apt install sidestep-plugins-ros1' "$trial/told"
}
try "without ROS" without_ros

# shellcheck disable=SC2086
try removal dpkg --purge $names
rm -rf "$trial"
