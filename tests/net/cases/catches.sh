# What the net is for: whatever changes in what a run leaves is seen, and nothing else.
run whole 0 plan.yaml

# sees LINES COMMAND...: that the command, which alters the run in the folder `altered`, makes these lines
# differ, marked as `diff` does.
sees() {
  local lines=$1 seen
  shift
  rm -rf altered kept looked
  cp -r whole altered
  "$@"
  cp whole.code altered.code
  cp whole.stderr altered.stderr
  sed 's#whole/#altered/#' whole.stdout >altered.stdout
  mkdir kept looked
  cp -r all/whole kept/run
  node "$here/transcribe.mjs" altered looked/run
  node "$here/settle.mjs" kept looked
  seen=$(diff -r -U0 kept looked | grep '^[+-][^+-]') || true
  [ "$seen" = "$lines" ] || {
    diff <(echo "$lines") <(echo "$seen") || true
    complain "sees other lines than expected of: $*"
  }
}
in_summary() { sed -i "0,/$1/s//$2/" altered/summary.json; }
in_report() { sed -i "0,/$1/s//$2/" altered/report.html; }
in_results() { sqlite3 altered/results.sqlite "$1"; }
frame="WHERE series = 'frame' AND item = 3 AND key"
depth="WHERE series = 'depth' AND item = 0"

sees '' true
sees '' in_results "UPDATE measurements SET value = 1234.5 $frame = 'frame_ms'"
sees '' in_results "UPDATE measurements SET value = value * (1 + 1e-9) WHERE typeof(value) = 'real'"
sees '-summary.plans[there].attempts = 2
+summary.plans[there].attempts = 3' in_summary '"attempts": 2' '"attempts": 3'
sees '-summary.plans[there].cost = 0.202672
+summary.plans[there].cost = 0.20269' in_summary '"cost": 0.20267[0-9]*' '"cost": 0.20269'
sees '-summary.plans[there].valid_snapshot = true
+summary.plans[there].valid_snapshots = true' in_summary '"valid_snapshot"' '"valid_snapshots"'
sees '-summary.plans[there].solve_ms = (time)
+summary.plans[there].solve_ms = null' in_summary '"solve_ms": [0-9.]*' '"solve_ms": null'
sees '-  "there" | "success" | "valid" | "valid" | "exactly" | "0.078 m" | "6.50 s" | "3.17 s" | (time) | "19" | "0.2027" | "2"
+  "there" | "success" | "valid" | "valid" | "exactly" | "0.079 m" | "6.50 s" | "3.17 s" | (time) | "19" | "0.2027" | "2"' \
  in_report '<td>0.078 m' '<td>0.079 m'
sees '-results measurements frame 3 points = 3290' in_results "DELETE FROM measurements $frame = 'points'"
sees '-results measurements frame 3 frame_ms = (time)' in_results "DELETE FROM measurements $frame = 'frame_ms'"
sees '+results measurements frame 4 points = 3290' \
  in_results "INSERT INTO measurements SELECT series, 4, key, value FROM measurements $frame = 'points'"
sees '-results arrays depth 0 depth_m .float32 = mean 1.7804, rms 2.189, by place 1.986
+results arrays depth 0 depth_m .float32 = mean 1.7804, rms 2.189, by place 1.9827' \
  in_results "UPDATE arrays SET float32 = (SELECT float32 FROM arrays WHERE series = 'depth' AND item = 2) $depth"
sees '+schema: CREATE INDEX items ON measurements (item);' in_results "CREATE INDEX items ON measurements (item)"
sees '-file: depth.svg' rm altered/depth.svg
