# libbrickpilot_avr: the plant and simavr in one process. Without simavr's library it is left out, and `hil --target avr` says so.

# What needs no simavr, and is tested by itself.
add_library(avr_drive STATIC avr/bridge.c avr/profile.c avr/quadrature.c)
target_include_directories(avr_drive PUBLIC . include)
target_link_libraries(avr_drive PUBLIC m)

find_path(SIMAVR_INCLUDE simavr/sim_avr.h)
find_library(SIMAVR_LIBRARY simavr)
find_path(ELF_INCLUDE gelf.h)
find_library(ELF_LIBRARY elf)
if(NOT (SIMAVR_INCLUDE AND SIMAVR_LIBRARY AND ELF_INCLUDE AND ELF_LIBRARY))
  message(STATUS "hil --target avr is left out: it needs simavr (sudo apt-get install libsimavr-dev libelf-dev)")
  return()
endif()
file(GLOB avr_sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_LIST_DIR}/*.c)
list(FILTER avr_sources EXCLUDE REGEX "/(bridge|profile|quadrature)\\.c$")
add_library(brickpilot_avr SHARED ${avr_sources})
set_target_properties(brickpilot_avr PROPERTIES PREFIX lib INSTALL_RPATH "$ORIGIN")
target_include_directories(brickpilot_avr PUBLIC . include ../firmware ../hal ../hal/include)
target_include_directories(brickpilot_avr SYSTEM PRIVATE ${SIMAVR_INCLUDE} ${SIMAVR_INCLUDE}/simavr ${ELF_INCLUDE})
target_link_libraries(brickpilot_avr PRIVATE avr_drive brickpilot_sim ${SIMAVR_LIBRARY} ${ELF_LIBRARY} m)
