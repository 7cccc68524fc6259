#!/usr/bin/env bash
# Installs what is missing, builds the command and the plugins that a configuration names, and runs it.
# What was built before is kept up to date; tools/build.sh builds everything.
#
#   tools/run.sh                                     the demo
#   tools/run.sh CONFIG... [options of sidestep run] any experiment
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
[ $# -gt 0 ] || set -- "$root/configs/demo.yaml"

# Prints the plugins that a configuration and what it builds on name.
named_plugins() {
  local base
  grep -oE '(plugin|type): *[a-z0-9_]+' "$1" | sed 's/.*: *//' || true
  for base in $(sed -n 's/^base: *//p' "$1" | tr -d '[],"'); do
    [ ! -f "$(dirname "$1")/$base" ] || named_plugins "$(dirname "$1")/$base"
  done
}

named=()
for argument in "$@"; do
  for file in "$argument" "$root/configs/$argument.yaml"; do
    [ ! -f "$file" ] || mapfile -t -O ${#named[@]} named < <(named_plugins "$file")
  done
  [[ ! $argument =~ (plugin|type)[:=]\ *([a-z0-9_]+) ]] || named+=("${BASH_REMATCH[2]}")
done
for library in "$root"/build/release/lib/sidestep/plugins/lib*.so; do
  [ -f "$library" ] || continue
  library=${library##*/lib}
  library=${library#*_}
  named+=("${library%.so}")
done
targets=(sidestep)
for name in "${named[@]}"; do
  if compgen -G "$root/plugins/*/$name" >/dev/null; then targets+=("plugin_$name"); fi
done
"$root/tools/build.sh" release "${targets[@]}"
exec "$root/build/release/bin/sidestep" run "$@"
