#!/usr/bin/env bash
# A tree in which each kind of link is broken once: the site must name each, and nothing else.
#
#   broken_links_test.sh SITE_SH
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
tree=$folder/tree
mkdir -p "$tree/docs/decisions" "$tree/docs/tutorials" "$tree/docs/reference" "$tree/framework/include/sidestep/core"
echo '# Changes' >"$tree/CHANGELOG.md"
echo '# Contributing' >"$tree/CONTRIBUTING.md"
echo '# Decisions' >"$tree/docs/decisions/README.md"
echo '# Templates' >"$tree/docs/tutorials/write_a_plugin.md"
echo '# Parameters' >"$tree/docs/reference/plugins.md"
echo '/// Has one parameter. \param other Which it has not.
void scale(double factor);' >"$tree/framework/include/sidestep/core/scale.hpp"
cat >"$tree/docs/README.md" <<END
# Documentation

[up](../README.md), [down](decisions/), [here](#documentation), [there](../README.md#a-tree), [a file](../LICENSE.txt)
END
cp "$tree/docs/README.md" "$tree/LICENSE.txt"
cat >"$tree/README.md" <<END
# A tree

[a page](docs/gone_page.md), [a heading](docs/README.md#gone-heading), [a source](docs/gone.cpp),
![a picture](docs/gone.png), [a heading here](#gone-here), <a href="docs/gone.html">a page</a>
END

found=$("$1" "$folder/out" "$tree" 2>&1) && status=0 || status=$?
echo "$found"
[ $status -ne 77 ] || exit 77
[ $status -eq 1 ] || { echo "the site was built all the same"; exit 1; }
for wrong in "'other' of command @param" gone_page.md gone-heading gone.cpp gone.png gone-here gone.html; do
  grep -q -- "$wrong" <<<"$found" || { echo "not told: $wrong"; exit 1; }
done
[ "$(grep -c 'WARNING\|is not there' <<<"$found")" -eq 7 ] || { echo "more is told than is wrong"; exit 1; }
