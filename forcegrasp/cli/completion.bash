# Completion of forcegrasp for bash, made by: forcegrasp completion bash
_forcegrasp_verbs='@VERBS@'
_forcegrasp_table='@TABLE@'

_forcegrasp() {
  local IFS=$' \t\n'
  # The word so far. Bash's own words end at =, and it replaces only what comes after; within quotes it replaces all.
  local typed=${COMP_LINE:0:COMP_POINT} quoted= verb=${COMP_WORDS[1]} row words word file
  typed=${typed##*[[:space:]]}
  case $typed in [\"\']*) quoted=${typed:0:1} typed=${typed:1} ;; esac
  local key=${typed%%=*} kept= value=$typed candidates=()

  if ((COMP_CWORD <= 1)); then
    while IFS=: read -r word _; do candidates+=("$word"); done <<<"$_forcegrasp_verbs"
    candidates+=(--help --version)
  elif [[ $typed == *=* ]]; then
    kept=$key= value=${typed#*=}
    while read -r -a row; do
      [[ ${row[0]} == "$verb" && ${row[1]} == "$key" ]] || continue
      if [[ " ${row[*]:2} " == *' , '* && $value == *[\[,]* ]]; then
        word=${value##*[\[,]}
        kept+=${value%"$word"} value=$word
      fi
      words=("${row[@]:2}")
    done <<<"$_forcegrasp_table"
    candidates=("${words[@]}")
  else
    while read -r -a row; do
      [[ ${row[0]} == "$verb" ]] || continue
      if [[ ${row[1]} == - ]]; then candidates+=("${row[@]:2}"); else candidates+=("${row[1]}="); fi
    done <<<"$_forcegrasp_table"
  fi

  COMPREPLY=()
  for word in "${candidates[@]}"; do
    if [[ $word == @ ]]; then
      while IFS= read -r file; do
        if [[ -d $file ]]; then file+=/; fi
        COMPREPLY+=("$kept$file")
      done < <(compgen -f -- "$value")
    elif [[ $word != , && $word == "$value"* ]]; then
      COMPREPLY+=("$kept$word")
    fi
  done
  if [[ ${#COMPREPLY[@]} == 1 && (${COMPREPLY[0]} == *[=/] || $kept == *[\[,]) ]]; then compopt -o nospace; fi
  if [[ -z $quoted && $kept == *=* && $COMP_WORDBREAKS == *=* ]]; then COMPREPLY=("${COMPREPLY[@]#"$key="}"); fi
}
complete -F _forcegrasp forcegrasp
