#!/usr/bin/env bash
# Whether the configurations that the documentation and the configurations' own comments say how to
# run or check are there, by name or by path. `my.yaml` is the reader's own.
#
#   check_names.sh
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

found=0
missing=0
while IFS=: read -r page line command; do
  name=${command##* }
  name=${name#configs/}
  found=$((found + 1))
  [ -f "configs/${name%.yaml}.yaml" ] && continue
  echo "$page:$line: there is no configuration '$name'"
  missing=1
done < <(grep -rnoP --include=*.md --include=*.yaml \
  'sidestep (run|check) (configs/)?(?!my\.yaml)[a-z][a-z0-9_]*+(/[a-z0-9_]++)*+(\.yaml)?+(?![\w{*$])' \
  README.md docs configs plugins tools robots)
[ "$found" -gt 0 ] || { echo "no command was found"; exit 1; }
exit $missing
