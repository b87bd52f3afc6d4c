# Completion of forcegrasp for fish, made by: forcegrasp completion fish
set -g __forcegrasp_verbs '@VERBS@'
set -g __forcegrasp_table '@TABLE@'

function __forcegrasp
    set -l words (commandline -opc)
    set -l typed (string trim --left --chars "'\"" -- (commandline -ct))
    if test (count $words) -lt 2
        string replace : \t -- (string split \n -- $__forcegrasp_verbs)
        printf '%s\n' --help --version
        return
    end
    set -l key (string split --max 1 = -- $typed)
    for row in (string split \n -- $__forcegrasp_table)
        set -l fields (string split ' ' -- $row)
        test "$fields[1]" = "$words[2]"; or continue
        if test (count $key) -eq 1
            if test "$fields[2]" = -
                __forcegrasp_values '' "$typed" $fields[3..]
            else
                echo $fields[2]=
            end
        else if test "$fields[2]" = "$key[1]"
            set -l kept "$key[1]="
            set -l value "$key[2]"
            if contains -- , $fields; and set -l head (string match --regex '^.*[\[,]' -- $value)
                set value (string replace -- "$head" '' $value)
                set kept "$kept$head"
            end
            __forcegrasp_values "$kept" "$value" $fields[3..]
        end
    end
end

function __forcegrasp_values --argument-names kept value
    for word in $argv[3..]
        switch $word
            case ,
            case @
                printf '%s\n' $kept(__fish_complete_path "$value" | string replace --regex '\t.*' '')
            case '*'
                echo $kept$word
        end
    end
end

complete --command forcegrasp --no-files --arguments '(__forcegrasp)'
