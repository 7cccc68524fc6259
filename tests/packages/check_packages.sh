#!/usr/bin/env bash
# Makes the packages, and tries them as those do who install them.
#
#   check_packages.sh BUILD WORK          over this machine's root, by an overlay that is gone afterwards; needs root
#   check_packages.sh BUILD WORK clean    on a new root, with apt and mmdebstrap; needs root
set -euo pipefail
build=$1 work=$2 where=${3:-here}
source=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)

say() { printf '%s\n' "$*"; }
[ "$(id -u)" -eq 0 ] || { say "skipped: packages are installed by root alone"; exit 77; }

rm -rf "$work"
mkdir -p "$work/debs"
cpack --config "$build/CPackConfig.cmake" -B "$work/debs" >"$work/cpack.log" 2>&1 || { cat "$work/cpack.log"; exit 1; }
rm -rf "$work/debs/_CPack_Packages"
version=$(sed -n 's/^set(CPACK_PACKAGE_VERSION "\(.*\)")$/\1/p' "$build/CPackConfig.cmake")
for name in libsidestep1 libsidestep-dev python3-sidestep sidestep sidestep-plugins sidestep-plugins-ros1; do
  deb=$work/debs/${name}_${version}_$(dpkg --print-architecture).deb
  [ -f "$deb" ] || { say "no package $name $version"; exit 1; }
  dpkg-deb -c "$deb" >"$work/contents.txt"
  grep -q "/usr/share/doc/$name/copyright$" "$work/contents.txt" || { say "$name has no copyright"; exit 1; }
done
# The ROS packages alone want ROS.
if dpkg-deb -f "$work/debs/sidestep-plugins_"*.deb Depends | grep -i ros; then
  say "sidestep-plugins needs ROS"
  exit 1
fi
grep -q "<version>$version</version>" "$source/package.xml" || { say "package.xml has another version than $version"; exit 1; }
lintian --allow-root --fail-on error "$work/debs"/*.deb >"$work/lintian.txt" 2>&1 || { cat "$work/lintian.txt"; exit 1; }

cp "$source/tests/packages/try_packages.sh" "$source/docs/examples/embed.cpp" "$work/debs"
if [ "$where" = clean ]; then
  . /etc/os-release
  mmdebstrap --variant=apt --include=g++,cmake,make,pkg-config \
    --customize-hook="copy-in $work/debs /opt" --customize-hook='chroot "$1" bash /opt/debs/try_packages.sh apt' \
    --customize-hook='rm -r "$1/opt/debs"' \
    --customize-hook='! find "$1" -xdev -path "$1/var/lib/apt" -prune -o -path "$1/var/log" -prune -o -iname "*sidestep*" -print | grep .' \
    "$VERSION_CODENAME" /dev/null /etc/apt/sources.list.d/debian.sources >"$work/clean.log" 2>&1 || { cat "$work/clean.log"; exit 1; }
  grep -A99 '^install: ' "$work/clean.log"
  exit
fi

# Mounts are this process's own, and end with it.
export work
exec unshare --mount --propagation private bash -euc '
mkdir -p "$work/layer"
mount -t tmpfs tmpfs "$work/layer"
mkdir "$work/layer/upper" "$work/layer/work" "$work/layer/root"
mount -t overlay overlay -o "lowerdir=/,upperdir=$work/layer/upper,workdir=$work/layer/work" "$work/layer/root" ||
  { echo "skipped: no overlay can be mounted"; exit 77; }
root=$work/layer/root
for folder in proc dev; do mount --rbind "/$folder" "$root/$folder"; done
rm -rf "$root/opt/debs"
cp -r "$work/debs" "$root/opt/debs"
chroot "$root" bash /opt/debs/try_packages.sh dpkg
# What was written and is still there, but where Debian notes what is installed.
cd "$work/layer/upper"
left=$(find . -path ./tmp -prune -o -path ./opt/debs -prune -o -path ./var/lib/dpkg -prune -o -path ./var/log -prune -o \
  -path ./var/cache -prune -o -path ./etc/ld.so.cache -prune -o ! -type d -print -o -type d ! -exec test -e "/{}" \; -print)
[ -z "$left" ] || { printf "%s\n" "left behind:" "$left"; exit 1; }
'
