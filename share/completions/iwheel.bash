# SPDX-License-Identifier: MIT
# shellcheck shell=bash
# Completion for iwheelctl, iwheel-gateway and iwheel-sim. It asks the program itself, so it always matches the installed version.

# Lists the CAN interfaces.
_iwheel_buses() {
    grep -lx 280 /sys/class/net/*/type 2>/dev/null | cut -d/ -f5
}

# Offers the words on standard input, with file names for FILE and CAN interfaces for BUS.
_iwheel_offer() {
    local words
    words=$(cat)
    mapfile -t COMPREPLY < <(compgen -W "$(grep -vxE 'FILE|BUS' <<<"$words")" -- "$2")
    if grep -qx BUS <<<"$words" && [[ $2 != -* ]]; then
        mapfile -t -O "${#COMPREPLY[@]}" COMPREPLY < <(compgen -W "$(_iwheel_buses)" -- "$2")
    fi
    if grep -qx FILE <<<"$words" && [[ $2 != -* ]]; then
        mapfile -t -O "${#COMPREPLY[@]}" COMPREPLY < <(compgen -f -- "$2")
    fi
}

# Offers the values of the option before the cursor. Returns 1 if the option has no value, or an unknown one.
_iwheel_value() {
    case $1 in
    --socket | --config | -c | --from | --learn | --gateway | --directory | --control | --script | --log | --output) echo FILE ;;
    --can) echo BUS && echo unix: ;;
    --estop) printf '%s\n' none FILE ;;
    --to) printf '%s\n' mcap csv blf rosbag2 ;;
    --log-level) printf '%s\n' error warning info debug ;;
    --how | --for | --listen | --rate | --frames | --current | --seed | --uptime | --last | --since | --until | --wait) ;;
    *) return 1 ;;
    esac
}

_iwheelctl() {
    local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} verb='' i verbs
    verbs=$("$1" help --list 2>/dev/null | cut -f1)
    for ((i = 1; i < COMP_CWORD; i++)); do
        if grep -qxF -- "${COMP_WORDS[i]}" <<<"$verbs"; then
            verb=${COMP_WORDS[i]}
            break
        fi
    done
    if _iwheel_value "$previous" >/dev/null; then
        _iwheel_offer "$1" "$current" < <(_iwheel_value "$previous")
    elif [ -n "$verb" ]; then
        _iwheel_offer "$1" "$current" < <("$1" help "$verb" --list 2>/dev/null)
    else
        _iwheel_offer "$1" "$current" < <(printf '%s\n' "$verbs" && [[ $current == -* ]] && printf '%s\n' --socket --json --help --version)
    fi
}

_iwheel_program() {
    local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]}
    if _iwheel_value "$previous" >/dev/null; then
        _iwheel_offer "$1" "$current" < <(_iwheel_value "$previous")
    else
        _iwheel_offer "$1" "$current" < <("$1" --help 2>/dev/null | grep -oE -- '--[a-z][a-z-]*' | sort -u)
    fi
}

complete -o filenames -F _iwheelctl iwheelctl
complete -o filenames -F _iwheel_program iwheel-gateway iwheel-sim
