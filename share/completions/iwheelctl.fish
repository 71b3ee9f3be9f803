# SPDX-License-Identifier: MIT
# Completion for fish. It asks the program itself, so it always matches the installed version.

function __iwheel_buses
    grep -lx 280 /sys/class/net/*/type 2>/dev/null | cut -d/ -f5
end

# Prints the verb on the command line.
function __iwheelctl_verb
    set -l verbs (iwheelctl help --list 2>/dev/null | cut -f1)
    for word in (commandline -opc)[2..-1]
        if contains -- $word $verbs
            echo $word
            return 0
        end
    end
    return 1
end

# Prints the words that may follow, with file names for FILE and CAN interfaces for BUS.
function __iwheelctl_words
    set -l verb (__iwheelctl_verb)
    for word in (iwheelctl help $verb --list 2>/dev/null)
        switch $word
            case FILE
                __fish_complete_path (commandline -ct)
            case BUS
                __iwheel_buses
            case '*'
                echo $word
        end
    end
end

# Prints the values of the option before the cursor. Fails if the option has no value.
function __iwheel_value
    set -l previous (commandline -opc)[-1]
    switch $previous
        case --socket --config -c --from --learn --gateway --directory --control --script --log --output
            __fish_complete_path (commandline -ct)
        case --can
            __iwheel_buses
        case --estop
            echo none
            __fish_complete_path (commandline -ct)
        case --to
            printf '%s\n' mcap csv blf rosbag2
        case --log-level
            printf '%s\n' error warning info debug
        case --how --for --listen --rate --frames --current --seed --uptime --last --since --until --wait
        case '*'
            return 1
    end
end

function __iwheel_offer
    if __iwheel_value
        return
    end
    if __iwheelctl_verb >/dev/null
        __iwheelctl_words
        return
    end
    iwheelctl help --list 2>/dev/null
    printf '%s\n' --socket --json --help --version
end

function __iwheel_program_offer
    if not __iwheel_value
        set -l name (commandline -opc)[1]
        $name --help 2>/dev/null | grep -oE -- '--[a-z][a-z-]*' | sort -u
    end
end

complete -c iwheelctl -f -a '(__iwheel_offer)'
complete -c iwheel-gateway -f -a '(__iwheel_program_offer)'
complete -c iwheel-sim -f -a '(__iwheel_program_offer)'
