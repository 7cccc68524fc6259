# Every type that the command knows has a case here.
printf 'schema_version: 1\nexperiment: {}\n' >untyped.yaml
run untyped 2 untyped.yaml
types=$(sed -n 's/.*, one of \(.*\))$/\1/p' untyped.stderr | tr -d ,)
[ -n "$types" ] || complain "the command names no type of experiment"
for type in $types; do
  [ -f "$here/cases/$type.sh" ] || complain "no case for the experiment type '$type'"
done
keeps_ends untyped
