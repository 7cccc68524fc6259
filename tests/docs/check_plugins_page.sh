#!/usr/bin/env bash
# Whether the page of parameters is what the plugins declare today. Of plugins that this build lacks, the
# page has sections that are passed over.
#
#   check_plugins_page.sh SIDESTEP PAGE NOT_BUILT
set -euo pipefail
sidestep=$1 page=$2 not_built=$3

# Each plugin is in one library.
if "$sidestep" plugins 2>&1 >/dev/null | grep 'is taken from'; then exit 1; fi

"$sidestep" plugins --markdown |
  diff -u <(awk '
    FNR == NR { if (NF > 1) missing["## " $1 ": " $2] = 1; next }
    /^## / { skipped = ($0 in missing) }
    !skipped' "$not_built" "$page") - || {
  echo 'run: sidestep plugins --markdown > docs/reference/plugins.md'
  exit 1
}
