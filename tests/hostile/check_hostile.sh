#!/usr/bin/env bash
# Inputs that once ended in a crash, in a process that never came back, or in a success that was none. Each has to end in an
# error that names what is wrong and where, within a second of the processor's time and 4 GiB of address space; what is
# right within five seconds.
#
#   check_hostile.sh SIDESTEP SOURCE WORK
set -uo pipefail
sidestep=$1 source=$2 work=$3
rm -rf "$work" && mkdir -p "$work" && cd "$work" || exit 1
failed=0
TIMEFORMAT='%U %S'

# refused CODE TEXT... -- ARGUMENTS: what the command ends with, and what it says. The least of three times counts, of a
# machine that does other things beside.
refused() {
  local expected=$1 texts=() code most_s=1 spent text
  shift
  while [ "$1" != -- ]; do texts+=("$1") && shift; done
  shift
  [ "$expected" -ne 0 ] || most_s=5
  for _ in 1 2 3; do
    code=0
    spent=$({ time (ulimit -t 20 -v 4194304 && timeout 60 "$sidestep" "$@" >out 2>err </dev/null) || code=$?
      echo "$code" >code; } 2>&1)
    code=$(cat code)
    ! awk "{exit !(\$1 + \$2 < $most_s)}" <<<"$spent" || break
    spent+=" s, more than $most_s"
  done
  for text in "${texts[@]}"; do
    grep -qF -- "$text" err || { echo "$*: '$text' is not in:" && head -c 2000 err && failed=1; }
  done
  [ "$code" -eq "$expected" ] || { echo "$*: exit code $code, expected $expected" && head -c 2000 err && failed=1; }
  [[ "$spent" != *more* ]] || { echo "$*: takes $spent s" && failed=1; }
  [ "$(wc -c <err)" -lt 65536 ] || { echo "$*: $(wc -c <err) bytes of errors" && failed=1; }
}

# urdf FILE LINKS_AND_JOINTS
urdf() { printf '<robot name="r">\n%s\n</robot>\n' "$2" >"$1"; }
shape() { urdf "$1" "<link name=\"base\"><collision><geometry>$2</geometry></collision></link>"; }

shape box.urdf '<box size="0.3 0.9"/>'
refused 2 "box.urdf:2:" size -- robot box.urdf
shape cylinder.urdf '<cylinder radius="0,25" length="1"/>'
refused 2 "cylinder.urdf:2:" radius "0,25" -- robot cylinder.urdf
refused 2 protrusion_m -- robot hsr --fit --protrusion_m nan
refused 2 protrusion_m -- robot hsr --fit --protrusion_m inf
refused 2 protrusion_m -- robot hsr --fit --protrusion_m 1e-300
urdf chain.urdf "$(for i in {1..3000}; do
  echo "<link name=\"l$i\"/>"
  [ "$i" -eq 1 ] || echo "<joint name=\"j$i\" type=\"revolute\"><parent link=\"l$((i - 1))\"/><child link=\"l$i\"/>\
<axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\" velocity=\"1\" effort=\"1\"/></joint>"
done)"
refused 2 "chain.urdf:1:1" "more than 1000 links" -- robot chain.urdf
urdf deep.urdf "$(printf '<a>%.0s' {1..200000})"
refused 2 "deep.urdf:2:598: XML elements are nested" "200 at most" -- robot deep.urdf

# Configurations.
printf 'schema_version: 1\nbase: [b1.yaml, b1.yaml]\n' >doubling.yaml
for i in {1..40}; do printf 'schema_version: 1\nbase: [b%d.yaml, b%d.yaml]\n' $((i + 1)) $((i + 1)) >"b$i.yaml"; done
echo 'schema_version: 1' >b41.yaml
refused 2 "files" 200 -- check doubling.yaml
printf 'schema_version: 1\nbase: /dev/zero\n' >zero.yaml
refused 2 "zero.yaml:2:7" "/dev/zero: this is a pipe or a device" -- check zero.yaml
mkfifo fifo && printf 'schema_version: 1\nbase: fifo\n' >pipe.yaml
refused 2 "pipe.yaml:2:7" "fifo: this is a pipe or a device" -- check pipe.yaml
refused 2 "/dev/zero" -- check /dev/zero
{ echo 'schema_version: 1' && for i in {1..40000}; do echo "key_$i: 1"; done; } >keys.yaml
refused 2 "keys.yaml:2:1" "unknown key" "more" -- check keys.yaml
{ echo 'a: &a0 [1, 1, 1, 1, 1, 1, 1, 1]' && for i in {1..30}; do
  echo "b$i: &a$i [*a$((i - 1)), *a$((i - 1)), *a$((i - 1)), *a$((i - 1))]"
done; } >laughs.yaml
refused 2 "laughs.yaml:" "1000000 values at most" -- check laughs.yaml
printf '[%.0s' {1..100000} >nested.yaml
refused 2 "nested.yaml:1:" "100 deep at most" -- check nested.yaml

# A header that promises more pixels than the file can hold.
mkdir -p frames
printf '585 0 320\n0 585 240\n0 0 1\n' >frames/camera-intrinsics.txt
printf '1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n' >frames/frame-000000.pose.txt
printf '\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\x3f\xff\0\0\x3f\xff\x10\0\0\0\0\xae\x4a\xe9\x34\0\x01\0\0IDAT' >frames/frame-000000.depth.png
cat >frames.yaml <<EOF
schema_version: 1
base: $source/configs/demo.yaml
source: {plugin: depth_sequence, path: frames}
EOF
refused 1 "frame-000000.depth.png" "16383 x 16383 pixels, which 41 bytes cannot hold" -- run frames.yaml --out frames.out

# What a run left, changed.
"$sidestep" run "$source/configs/demo.yaml" --out run >/dev/null 2>&1 || { echo "the demo fails" && failed=1; }
cp -r run nan && sed -i '0,/: [0-9.]*,$/s//: NaN,/' nan/summary.json
refused 4 "nan/summary.json" -- report nan
for change in 's/"success": true/"success": "yes"/' 's/"experiment": "plan"/"experiment": ["plan"]/' \
  's/"configuration": "demo"/"configuration": {"a": 1}/' 's/"verdict": ".*"/"verdict": 3/'; do
  rm -rf types && cp -r run types && sed -i "$change" types/summary.json
  refused 4 "types/summary.json" "the summary is damaged" -- report types
done
cp -r run large
sqlite3 large/results.sqlite "UPDATE measurements SET value = value * 1e9 WHERE typeof(value) IN ('real', 'integer')"
refused 0 -- report large
exit $failed
