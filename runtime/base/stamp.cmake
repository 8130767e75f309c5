# Copies INPUT, a program in Python, to OUTPUT, with the line of VERSION_TEXT in place of "unknown" in its line VERSION = "unknown".
file(READ ${INPUT} text)
file(STRINGS ${VERSION_TEXT} version)
string(REPLACE "VERSION = \"unknown\"" "VERSION = \"${version}\"" stamped "${text}")
if(stamped STREQUAL text)
  message(FATAL_ERROR "${INPUT}: there is no line VERSION = \"unknown\" in it")
endif()
file(WRITE ${OUTPUT} "${stamped}")
