# Makes the page of carillon explore: cmake -DNPM=npm -DFROM=page/ -DWORK=folder -DTO=folder -DSOURCES=a;b -P make_page.cmake
# three.js comes from npm's registry, as package-lock.json has it. Where the registry cannot be reached there is no page, and the build continues.
file(MAKE_DIRECTORY ${WORK})
file(COPY ${FROM}/package.json ${FROM}/package-lock.json DESTINATION ${WORK})
execute_process(COMMAND ${NPM} ci --ignore-scripts --no-audit --no-fund --loglevel=error --fetch-retries=1 --fetch-retry-mintimeout=1000
  WORKING_DIRECTORY ${WORK} RESULT_VARIABLE result OUTPUT_VARIABLE text ERROR_VARIABLE text)
if(NOT result EQUAL 0)
  string(REGEX MATCH "[^\n]*[^\n ][^\n]*" first "${text}")
  message("carillon explore has no page: npm could not fetch three.js (${first}). Build again once its registry can be reached.")
  return()
endif()
file(REMOVE_RECURSE ${TO})
foreach(source ${SOURCES})
  file(COPY ${FROM}/${source} DESTINATION ${TO})
endforeach()
set(three ${WORK}/node_modules/three)
file(COPY ${three}/build/three.module.min.js ${three}/build/three.core.min.js ${three}/LICENSE DESTINATION ${TO}/three)
file(TOUCH ${TO}/main.js)
