#compdef forcegrasp
# Completion of forcegrasp for zsh, made by: forcegrasp completion zsh
_forcegrasp() {
  local verbs='@VERBS@'
  local table='@TABLE@'
  local verb=$words[2] key row
  local -a fields names options

  if ((CURRENT == 2)); then
    names=(${(f)verbs} --help --version)
    _describe verb names
    return
  fi
  if [[ $PREFIX == *=* ]]; then
    key=${PREFIX%%=*}
    compset -P '*='
    for row in ${(f)table}; do
      fields=(${=row})
      [[ $fields[1] == $verb && $fields[2] == $key ]] || continue
      names=(${fields[3,-1]:#(@|,)})
      if [[ $row == *" , "* ]]; then
        compset -P '*(\[|,)'
        compadd -q -S '' -a names
      else
        compadd -a names
      fi
      if (($fields[(Ie)@])); then _files; fi
    done
    return
  fi
  for row in ${(f)table}; do
    fields=(${=row})
    [[ $fields[1] == $verb ]] || continue
    if [[ $fields[2] == - ]]; then
      names=(${fields[3,-1]:#@})
      compadd -a names
      if (($fields[(Ie)@])); then _files; fi
    else
      options+=($fields[2]=)
    fi
  done
  compadd -S '' -a options
}
if [[ $funcstack[1] == _forcegrasp ]]; then _forcegrasp "$@"; else compdef _forcegrasp forcegrasp; fi
