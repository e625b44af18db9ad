# Unity, the C test framework: -DUNITY_ROOT=<folder with unity.c> for a copy of your own, else from the package registry, once for all builds.
set(UNITY_ROOT "" CACHE PATH "Folder that holds unity.c, unity.h and unity_internals.h")
if(NOT UNITY_ROOT)
  set(unity_folder ${PROJECT_SOURCE_DIR}/build/unity)
  set(UNITY_ROOT_FETCHED ${unity_folder}/pytest_unity-0.1.0/vendor/unity/src)
  if(NOT EXISTS ${UNITY_ROOT_FETCHED}/unity.c)
    find_package(Python3 REQUIRED COMPONENTS Interpreter)
    execute_process(
      COMMAND ${Python3_EXECUTABLE} -m pip download --quiet --disable-pip-version-check --no-deps --no-binary :all:
              --require-hashes -r ${CMAKE_CURRENT_SOURCE_DIR}/requirements-unity.txt -d ${unity_folder}
      COMMAND_ERROR_IS_FATAL ANY)
    file(ARCHIVE_EXTRACT INPUT ${unity_folder}/pytest_unity-0.1.0.tar.gz DESTINATION ${unity_folder})
  endif()
  set(unity_source ${UNITY_ROOT_FETCHED})
else()
  set(unity_source ${UNITY_ROOT})
endif()
if(NOT EXISTS ${unity_source}/unity.c)
  message(FATAL_ERROR "no unity.c in ${unity_source}: set UNITY_ROOT to the src folder of Unity")
endif()

add_library(unity STATIC ${unity_source}/unity.c)
target_include_directories(unity SYSTEM PUBLIC ${unity_source})
target_compile_definitions(unity PUBLIC UNITY_INCLUDE_DOUBLE UNITY_SUPPORT_64)
target_compile_options(unity PRIVATE -w)
