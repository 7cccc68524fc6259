# Completion of bash for `sidestep`: commands and options as `--help` lists them, installed configurations by name.
_sidestep() {
  local word=${COMP_WORDS[COMP_CWORD]} program command="" choices share
  program=$(type -P "${COMP_WORDS[0]}") || return
  share=$(dirname "$(readlink -f "$program")")/../share/sidestep
  ((COMP_CWORD == 1)) || command=${COMP_WORDS[1]}
  case $word in
    -*) choices=$("$program" ${command:+"$command"} --help 2>/dev/null | grep -oE -- '--[a-z][a-z_-]+') ;;
    *)
      case $command in
        "") choices=$("$program" --help 2>/dev/null | sed -n '/^Subcommands:/,$ s/^  \([a-z]\+\) .*/\1/p') ;;
        run | check) choices=$(cd "$share/configs" 2>/dev/null && compgen -G '*.yaml' | sed 's/\.yaml$//') ;;
        robot | certify) choices=$(cd "$share/robots" 2>/dev/null && compgen -G '*/profile.yaml' | xargs -n1 dirname) ;;
        new) ((COMP_CWORD > 2)) || choices=$(cd "$share/template" 2>/dev/null && compgen -G '*/README.md' | xargs -n1 dirname) ;;
      esac
      ;;
  esac
  mapfile -t COMPREPLY < <(compgen -W "$choices" -- "$word")
}
complete -o default -F _sidestep sidestep
