"""Shell completion: ``eval "$(cybership completion bash)"``; so for zsh, for fish with ``source``."""

from collections.abc import Sequence

from cosim import shipped_names
from cosim.command import run_command
from cybership.command_arguments import command_parser
from cybership.subcommands import all_modules

# One match a line, as names of files may have blanks. Options are those of the usage line, which ends at
# the first blank line of the help; what follows names options of other commands as well.
BASH = r"""_cybership() {{
    local IFS=$'\n' word="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}" usage=""
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W $'{commands}\n--help\n--version' -- "$word"))
        return
    fi
    if [ "${{word:0:1}}" = "-" ] || [ "${{before:0:2}}" = "--" ]; then
        usage="$("${{COMP_WORDS[0]}}" "${{COMP_WORDS[1]}}" --help 2> /dev/null | sed '/^$/q')"
    fi
    if [ "${{word:0:1}}" = "-" ]; then
        COMPREPLY=($(compgen -W "$(grep -oE -- '--[a-z][a-z-]*' <<< "$usage")" -- "$word"))
        return
    fi
    local values="$(grep -oE -- "$before [{{][a-z,]+" <<< "$usage" | grep -oE '[a-z,]+$')"
    if [ -n "$values" ]; then
        COMPREPLY=($(compgen -W "${{values//,/$'\n'}}" -- "$word"))
    elif [ "${{COMP_WORDS[1]}}" = completion ]; then
        COMPREPLY=($(compgen -W $'bash\nzsh\nfish' -- "$word"))
    else
        COMPREPLY=($(compgen -f -- "$word"))
        if [ "${{COMP_WORDS[1]}}" = run ] && [ "${{before:0:1}}" != "-" ]; then
            COMPREPLY+=($(compgen -W $'{scenarios}' -- "$word"))
        fi
    fi
}}
complete -o filenames -F _cybership cybership
"""
FISH = """complete -c cybership -n __fish_use_subcommand -f -a '{commands}'
complete -c cybership -n '__fish_seen_subcommand_from run' -a '{scenarios}'
"""
ZSH = "autoload -U +X compinit && compinit\nautoload -U +X bashcompinit && bashcompinit\n"
SHELLS = {"bash": BASH, "zsh": f"{ZSH}{BASH}", "fish": FISH}


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the completion of a shell; returns the exit code."""
    parser = command_parser(
        "cybership.completion",
        "Print the completion of commands, options and files for a shell.",
        'in ~/.bashrc or ~/.zshrc:  eval "$(cybership completion bash)", or zsh\n'
        "in config.fish:            cybership completion fish | source",
    )
    parser.add_argument("shell", choices=[*SHELLS], help="the shell")
    shell: str = parser.parse_args(arguments).shell
    between = " " if shell == "fish" else r"\n"
    names = {"commands": between.join(all_modules()), "scenarios": between.join(shipped_names())}
    print(SHELLS[shell].format(**names), end="")
    return 0


if __name__ == "__main__":
    run_command(main)
