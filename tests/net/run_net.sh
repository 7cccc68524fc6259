#!/usr/bin/env bash
# Holds what a user sees of experiments against what is kept of it: exit codes, tables and verdicts on
# stdout, summary.json, schema and rows of the databases, table.csv, the text of report.html.
#
#   run_net.sh [--keep] SIDESTEP WORK [CASE...]
#
# WORK is a folder for the runs. A CASE is a script in cases/, by default each of them: it makes runs with the
# functions below. --keep rewrites expected/CASE, for a change of results that is wanted: `git diff` then
# says what changed.
#
# Kernels run without AVX, so that every x86-64 processor rounds them alike. What remains of the processor is
# the mathematics of glibc and the ray caster: last bits, which are rounded away (lines.mjs, settle.mjs) as
# long as no iteration more or less comes of them.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
keep=no
if [ "${1:-}" = --keep ]; then
  keep=yes
  shift
fi
[ $# -ge 2 ] || {
  echo "usage: run_net.sh [--keep] SIDESTEP WORK [CASE...]" >&2
  exit 2
}
for tool in node sqlite3; do
  command -v "$tool" >/dev/null || {
    echo "needs $tool: tools/install_deps.sh installs it" >&2
    exit 1
  }
done
sidestep=$(realpath "$1")
mkdir -p "$2"
work=$(cd "$2" && pwd)
shift 2
export LC_ALL=C TZ=UTC SIDESTEP_INSTRUCTIONS=${SIDESTEP_INSTRUCTIONS:-any}
unset SIDESTEP_PLUGIN_PATH
most_lines=200  # of a difference that are shown

complain() {
  echo "net.$case: $*"
  failed=1
}

# differ ONE OTHER [OPTION...]: shows in what two folders differ; fails where they do not.
differ() {
  diff -ru "${@:3}" "$1" "$2" >difference && return 1
  head -n "$most_lines" difference
}

# finished NAME EXIT_CODE EXPECTED
finished() {
  echo "$2" >"$1.code"
  node "$here/transcribe.mjs" "$1" "all/$1"
  [ "$2" -eq "$3" ] || {
    complain "$1: exit code $2, expected $3"
    tail -n 20 "$1.stderr"
  }
}

# ends NAME EXIT_CODE ARGUMENT...: the command itself; what it writes in the folder NAME is looked at.
ends() {
  local name=$1 expected=$2 code=0
  shift 2
  "$sidestep" "$@" >"$name.stdout" 2>"$name.stderr" || code=$?
  finished "$name" "$code" "$expected"
}

# run NAME EXIT_CODE CONFIGURATION [OPTION...]
run() {
  ends "$1" "$2" run "$3" --out "$1" "${@:4}"
}

# resume NAME EXIT_CODE CONFIGURATION [OPTION...]: goes on with the run NAME.
resume() {
  ends "$1" "$2" run "$3" --resume "$1" "${@:4}"
}

# stop NAME WORDS CONFIGURATION [OPTION...]: a run that is asked to end once it says WORDS, and does so with
# part of its work done. One that was faster is begun anew.
stop() {
  local name=$1 words=$2 code attempt said pid line
  for attempt in 1 2 3; do
    code=0
    exec {said}< <(exec "$sidestep" run "$3" --out "$name" "${@:4}" 2>&1 >"$name.stdout")
    pid=$!
    while read -r line <&"$said"; do
      echo "$line"
      if [[ $line == *"$words"* ]]; then
        kill -TERM "$pid" || true
        break
      fi
    done >"$name.stderr"
    cat <&"$said" >>"$name.stderr"
    wait "$pid" || code=$?
    exec {said}<&-
    [ "$code" -eq 0 ] || break
  done
  finished "$name" "$code" 1
  grep -qx 'summary.interrupted = true' "all/$name/summary.txt" || complain "$name: was not interrupted"
}

# merge NAME EXIT_CODE RUN...: what shards make up.
merge() {
  ends "$1" "$2" report "${@:3}" --merged "$1"
}

# compare NAME EXIT_CODE RUN...: runs side by side, on a page in the folder NAME.
compare() {
  mkdir "$1"
  ends "$1" "$2" report "${@:3}" --comparison "$1/report.html"
}

# redraw RUN: that its page and pictures come out the same from its results alone.
redraw() {
  rm -f "$1"/report.html "$1"/*.png "$1"/*.svg
  "$sidestep" report "$1" >/dev/null || complain "$1: the report cannot be rebuilt"
  node "$here/transcribe.mjs" "$1" "redrawn/$1"
  if differ "all/$1" "redrawn/$1"; then complain "$1: the rebuilt report differs"; fi
}

# same ONE OTHER: that two runs say the same, but for how often they were begun and how they were put together.
same() {
  local name
  for name in "$1" "$2"; do node "$here/transcribe.mjs" "$name" "sessions/$name" sessions; done
  if differ "sessions/$1" "sessions/$2"; then complain "$2 differs from $1"; fi
}

# keeps RUN...: these are held against what is kept; the configuration that took effect, of the first.
keeps() {
  mkdir -p seen
  local name
  for name in "$@"; do
    cp -r "all/$name" seen
    [ "$name" = "$1" ] || rm -f "seen/$name/effective_config.txt"
  done
}

# keeps_ends RUN...: the same of exit code, stdout and stderr alone.
keeps_ends() {
  local name
  for name in "$@"; do
    mkdir -p "seen/$name"
    cp "all/$name/ends.txt" "seen/$name"
  done
}

if [ $# -eq 0 ]; then
  for script in "$here"/cases/*.sh; do
    name=${script##*/}
    set -- "$@" "${name%.sh}"
  done
fi

failed=0
for case in "$@"; do
  rm -rf "${work:?}/$case"
  mkdir -p "$work/$case"
  cd "$work/$case"
  cp "$here"/cases/*.yaml "$here"/cases/*.json .
  . "$here/cases/$case.sh"
  [ -d seen ] || continue
  kept=$here/expected/$case
  if [ "$keep" = yes ]; then
    rm -rf "$kept"
    mkdir -p "$here/expected"
    cp -r seen "$kept"
    continue
  fi
  node "$here/settle.mjs" "$kept" seen
  if differ "$kept" seen --new-file; then
    complain "differs from what is kept; all of the difference is in $PWD/difference"
  fi
done
exit $failed
