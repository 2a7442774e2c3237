# Bundle the page of neupig view: SOURCE (this folder) to PAGE, in WORK, with Node and npm.
#
# MODE AUTO: what can't be made (no network, say) is said, the build continues, and neupig view says what is missing.
# MODE ON: it is a failure.  STAMP is written in either case, so that a build does not try again and again; a new try is
# made when a source changes or the build is configured again.
file(REMOVE_RECURSE ${WORK}/src)
file(COPY ${SOURCE}/package.json ${SOURCE}/package-lock.json ${SOURCE}/build.mjs ${SOURCE}/src DESTINATION ${WORK})
function(step text)
  if(FAILED)
    return()
  endif()
  execute_process(COMMAND ${ARGN} WORKING_DIRECTORY ${WORK} RESULT_VARIABLE code OUTPUT_VARIABLE said
    ERROR_VARIABLE said TIMEOUT 300)
  if(NOT code EQUAL 0)
    set(FAILED "${text}: ${said}" PARENT_SCOPE)
  endif()
endfunction()
step("npm can't fetch what the page is made of" ${NPM} ci --ignore-scripts --no-audit --no-fund --prefer-offline
  --fetch-retries=1)
step("the page can't be bundled" ${NODE} build.mjs ${PAGE})
if(FAILED AND MODE STREQUAL "ON")
  message(FATAL_ERROR "${FAILED}")
elseif(FAILED)
  file(REMOVE ${PAGE})
  message(WARNING "neupig view will not work: ${FAILED}")
endif()
file(TOUCH ${STAMP})
