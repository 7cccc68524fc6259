#!/usr/bin/env bash
# Writes manual pages from what `--help` says: one for each program, and sidestep-COMMAND(1) for each command of sidestep.
#
#   write_manual.sh OUT BIN PROGRAM...
set -euo pipefail
out=$1 bin=$2
shift 2
export PATH=$bin:$PATH
mkdir -p "$out"
version=$(sidestep --version)
# page NAME COMMAND...: what the command's help begins with is its title.
page() {
  local name=$1 title
  shift
  title=$("$@" --help | head -n1)
  help2man --no-info --no-discard-stderr --section=1 --manual=Sidestep --source="${version}" --version-string="$version" \
    --name="${title%.}" --output="$out/$name.1.part" "$*"
  sed -i "s/^\.TH [^ ]*\( [^ ]*\)*\( \"1\"\)/.TH ${name^^}\2/" "$out/$name.1.part"
  mv "$out/$name.1.part" "$out/$name.1"
}
for program in "$@"; do page "$program" "$program"; done
for command in $(sidestep --help | sed -n '/^Subcommands:/,$ s/^  \([a-z]\+\) .*/\1/p'); do
  page "sidestep-$command" sidestep "$command"
done
