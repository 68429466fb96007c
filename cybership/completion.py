"""Shell completion: ``eval "$(cybership completion bash)"``; so for zsh, for fish with ``source``."""

import sys

from cosim import shipped_names
from cybership.subcommands import SUBCOMMANDS

BASH = """_cybership() {{
    local word="${{COMP_WORDS[COMP_CWORD]}}"
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W "{commands}" -- "$word"))
    elif [ "${{word:0:1}}" = "-" ]; then
        local help="$("${{COMP_WORDS[0]}}" "${{COMP_WORDS[1]}}" --help 2> /dev/null)"
        local known="$(grep -oE -- '--[a-z][a-z-]*' <<< "$help")"
        COMPREPLY=($(compgen -W "$known" -- "$word"))
    else
        COMPREPLY=($(compgen -f -- "$word"))
        if [ "${{COMP_WORDS[1]}}" = run ]; then
            COMPREPLY+=($(compgen -W "{scenarios}" -- "$word"))
        fi
    fi
}}
complete -o filenames -F _cybership cybership
"""
FISH = """complete -c cybership -n __fish_use_subcommand -f -a '{commands}'
complete -c cybership -n '__fish_seen_subcommand_from run' -a '{scenarios}'
"""
SHELLS = {"bash": BASH, "zsh": f"autoload -U +X bashcompinit && bashcompinit\n{BASH}", "fish": FISH}


def main(arguments: list[str]) -> int:
    """Print the completion of a shell; returns the exit code."""
    if len(arguments) != 1 or arguments[0] not in SHELLS:
        print("usage: cybership completion bash|zsh|fish\n", __doc__, file=sys.stderr)
        return 2
    names = {"commands": " ".join(SUBCOMMANDS), "scenarios": " ".join(shipped_names())}
    print(SHELLS[arguments[0]].format(**names), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
