#!/usr/bin/env bash
# Whether the configurations that the documentation shows are valid: every indented block that
# begins with schema_version and has an experiment.
#
#   check_examples.sh SIDESTEP PAGE...     paths in the examples are relative to the sources
set -euo pipefail
sidestep=$1
shift
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
ln -s "$root/configs" "$work/configs"

found=0
for page in "$@"; do
  awk -v out="$work/example-$(basename "$page" .md)" '
    /^    schema_version:/ { n++; copying = 1 }
    copying && !/^    / && !/^$/ { copying = 0 }
    copying { sub(/^    /, ""); print > (out "-" n ".yaml") }' "$page"
done
for example in "$work"/example-*.yaml; do
  grep -q '^experiment:' "$example" || continue
  found=$((found + 1))
  "$sidestep" check "$example" || { cat -n "$example"; exit 1; }
done
[ "$found" -gt 0 ] || { echo "no example was found"; exit 1; }
