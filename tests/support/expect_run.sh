# Sourced by what runs one configuration with many mistakes. Needs $sidestep, the command, $work, a
# folder, and $configuration; sets $failed to 1 where an expectation does not hold.
failed=0

# expect CODE TEXT KEY=VALUE...: the exit code and a line of the log of a run with these overrides.
expect() {
  local code=0 expected=$1 text=$2
  shift 2
  "$sidestep" run "$configuration" --out "$work/out" "${@/#/--set=}" >"$work/log" 2>&1 || code=$?
  if [ "$code" -ne "$expected" ] || ! grep -qF -- "$text" "$work/log"; then
    echo "$*: exit code $code, expected $expected and '$text' in:"
    cat "$work/log"
    failed=1
  fi
}
