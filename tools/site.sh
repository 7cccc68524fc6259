#!/usr/bin/env bash
# Builds the site of the documentation in OUT/html, and checks the links within it: Markdown where it lies, and the
# reference of the public headers. Fetches nothing. Exits with 77 without Sphinx or Doxygen (install_deps.sh --dev).
#
#   tools/site.sh [OUT [TREE]]     build/site and this checkout, unless given
set -euo pipefail
here=$(realpath "$(dirname "${BASH_SOURCE[0]}")/..")
out=$(realpath -m "${1:-$here/build/site}")
tree=$(realpath "${2:-$here}")
/usr/bin/python3 -c 'import breathe, furo, myst_parser' && command -v doxygen >/dev/null || {
  echo "site.sh: needs Sphinx, Furo, MyST, Breathe and Doxygen: tools/install_deps.sh --dev" >&2
  exit 77
}

# The tree as Sphinx sees it: links to what is there, README.md as the first page, and docs/conf.py on top.
rm -rf "$out"/{tree,xml,doctrees,html}
mkdir -p "$out/tree"
for path in "$tree"/*; do
  case ${path##*/} in
    build | out) ;;
    README.md) ln -s "$path" "$out/tree/index.md" ;;
    *) ln -s "$path" "$out/tree/" ;;
  esac
done
ln -s "$here/docs/conf.py" "$out/tree/conf.py"

status=0
doxygen - >"$out/doxygen.log" 2>&1 <<END || status=1
INPUT = $tree/framework/include/sidestep
RECURSIVE = YES
EXCLUDE = $tree/framework/include/sidestep/core/each_target.hpp
EXCLUDE_SYMBOLS = *::detail *::detail::* *::Impl sidestep::StoredRow::Inner*
STRIP_FROM_PATH = $tree/framework/include
OUTPUT_DIRECTORY = $out
GENERATE_HTML = NO
GENERATE_LATEX = NO
GENERATE_XML = YES
XML_PROGRAMLISTING = NO
MACRO_EXPANSION = YES
EXPAND_ONLY_PREDEF = YES
PREDEFINED = SIDESTEP_EXPORT= SIDESTEP_INLINE=inline SIDESTEP_SIMD_CLONES=
JAVADOC_AUTOBRIEF = YES
EXTRACT_ALL = YES
WARN_IF_UNDOCUMENTED = NO
QUIET = YES
END
cat "$out/doxygen.log" >&2
[ ! -s "$out/doxygen.log" ] || status=1

/usr/bin/python3 -m sphinx -q -W --keep-going -n -j 2 -d "$out/doctrees" -b html "$out/tree" "$out/html" || status=1
/usr/bin/python3 "$here/tools/check_site.py" "$out/html" || status=1
exit $status
