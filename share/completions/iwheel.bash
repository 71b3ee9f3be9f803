# SPDX-License-Identifier: MIT
# Completion for iwheelctl, iwheel-gateway and iwheel-sim. It asks the program itself, so it knows what that program knows.

# The options in a help text.
_iwheel_options() {
    "$@" --help 2>/dev/null | grep -oE -- '--[a-z][a-z-]*' | sort -u
}

_iwheelctl() {
    local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} verb= i verbs
    verbs=$("$1" --help 2>/dev/null | sed -nE 's/^  ([a-z]+)  +[^ ].*/\1/p')
    for ((i = 1; i < COMP_CWORD; i++)); do
        if grep -qxF -- "${COMP_WORDS[i]}" <<<"$verbs"; then
            verb=${COMP_WORDS[i]}
            break
        fi
    done
    case $previous in
    --socket) mapfile -t COMPREPLY < <(compgen -f -- "$current") && return ;;
    esac
    case $verb:$current in
    :-*) mapfile -t COMPREPLY < <(compgen -W "$(_iwheel_options "$1")" -- "$current") ;;
    :*) mapfile -t COMPREPLY < <(compgen -W "$verbs" -- "$current") ;;
    *:-*) mapfile -t COMPREPLY < <(compgen -W "$(_iwheel_options "$1" "$verb")" -- "$current") ;;
    tare:*) mapfile -t COMPREPLY < <(compgen -W "left right" -- "$current") ;;
    watch:*) mapfile -t COMPREPLY < <(compgen -W "state bus estop lease stop force frame" -- "$current") ;;
    *) mapfile -t COMPREPLY < <(compgen -f -- "$current") ;;
    esac
}

_iwheel_program() {
    local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]}
    case $previous:$current in
    --log-level:*) mapfile -t COMPREPLY < <(compgen -W "error warning info debug" -- "$current") ;;
    --can:*) mapfile -t COMPREPLY < <(compgen -W "$(cd /sys/class/net 2>/dev/null && grep -lx 280 -- */type 2>/dev/null | cut -d/ -f1)" -- "$current") ;;
    *:-*) mapfile -t COMPREPLY < <(compgen -W "$(_iwheel_options "$1")" -- "$current") ;;
    *) mapfile -t COMPREPLY < <(compgen -f -- "$current") ;;
    esac
}

complete -F _iwheelctl iwheelctl
complete -F _iwheel_program iwheel-gateway iwheel-sim
