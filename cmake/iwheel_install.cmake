# SPDX-License-Identifier: MIT
# What `cmake --install` puts where, in components: gateway, tools, ros2, dev (the core for other programs).
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(iwheel_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/iwheel)
install(TARGETS iwheel_core EXPORT iwheelTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT dev)
install(DIRECTORY core/include/iwheel DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT dev)
install(EXPORT iwheelTargets NAMESPACE iwheel:: FILE iwheelConfig.cmake DESTINATION ${iwheel_package_dir} COMPONENT dev)
write_basic_package_version_file(iwheelConfigVersion.cmake COMPATIBILITY SameMinorVersion)
# The package may be moved: iwheel.pc tells the prefix from where it lies.
file(RELATIVE_PATH IWHEEL_PC_PREFIX /x/${CMAKE_INSTALL_LIBDIR}/pkgconfig /x)
configure_file(cmake/iwheel.pc.in iwheel.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/iwheelConfigVersion.cmake DESTINATION ${iwheel_package_dir} COMPONENT dev)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/iwheel.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT dev)

# Manual pages, if scdoc is there. Page, section, component.
find_program(IWHEEL_SCDOC scdoc DOC "Makes the manual pages; without it there are none")
mark_as_advanced(IWHEEL_SCDOC)
function(iwheel_man name section component)
    set(page ${CMAKE_CURRENT_BINARY_DIR}/man/${name}.${section})
    set(source ${CMAKE_CURRENT_SOURCE_DIR}/man/${name}.${section}.scd)
    add_custom_command(OUTPUT ${page} DEPENDS ${source} VERBATIM
        COMMAND ${CMAKE_COMMAND} -E make_directory ${CMAKE_CURRENT_BINARY_DIR}/man
        COMMAND sh -c "\"$1\" <\"$2\" >\"$3\"" sh ${IWHEEL_SCDOC} ${source} ${page})
    add_custom_target(man-${name} ALL DEPENDS ${page})
    install(FILES ${page} DESTINATION ${CMAKE_INSTALL_MANDIR}/man${section} COMPONENT ${component})
endfunction()

if(TARGET iwheel-ros2)
    install(TARGETS iwheel-ros2 RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT ros2)
    install(FILES share/ros2.conf DESTINATION ${CMAKE_INSTALL_SYSCONFDIR}/iwheel COMPONENT ros2)
    install(FILES share/sysusers.d/iwheel-ros2.conf DESTINATION lib/sysusers.d COMPONENT ros2)
endif()
if(TARGET iwheel-gateway)
    install(TARGETS iwheel-gateway RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT gateway)
    set(IWHEEL_SYSTEMD_DIR lib/systemd/system CACHE STRING "Where the service units go")
    set(IWHEEL_UDEV_DIR lib/udev/rules.d CACHE STRING "Where the udev rules go")
    install(FILES share/systemd/iwheel-gateway.service share/systemd/iwheel-gateway@.service
        share/systemd/iwheel-can-restart@.path share/systemd/iwheel-can-restart@.service
        DESTINATION ${IWHEEL_SYSTEMD_DIR} COMPONENT gateway)
    if(TARGET iwheel-ros2)
        install(FILES share/systemd/iwheel-ros2.service DESTINATION ${IWHEEL_SYSTEMD_DIR} COMPONENT ros2)
    endif()
    install(FILES share/sysusers.d/iwheel.conf DESTINATION lib/sysusers.d COMPONENT gateway)
    install(FILES share/tmpfiles.d/iwheel.conf DESTINATION lib/tmpfiles.d COMPONENT gateway)
    install(FILES share/sysctl.d/10-iwheel.conf DESTINATION lib/sysctl.d COMPONENT gateway)
    install(FILES share/udev/60-iwheel.rules DESTINATION ${IWHEEL_UDEV_DIR} COMPONENT gateway)
    install(FILES share/networkd/70-iwheel-can.link share/networkd/80-iwheel-can.network
        DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/iwheel-gateway/examples COMPONENT gateway)
    install(FILES share/gateway.conf DESTINATION ${CMAKE_INSTALL_SYSCONFDIR}/iwheel COMPONENT gateway)
    install(TARGETS iwheelctl iwheel-sim RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT tools)
    install(FILES share/iwheel.dbc share/northbound.json DESTINATION ${CMAKE_INSTALL_DATADIR}/iwheel COMPONENT tools)
    install(FILES share/completions/iwheel.bash RENAME iwheelctl
        DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT tools)
    install(FILES share/completions/_iwheelctl DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions COMPONENT tools)
    foreach(program iwheelctl iwheel-gateway iwheel-sim) # fish looks for a file of each program's name.
        install(FILES share/completions/iwheelctl.fish RENAME ${program}.fish
            DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT tools)
    endforeach()
    if(IWHEEL_SCDOC)
        iwheel_man(iwheel-gateway 1 gateway)
        iwheel_man(iwheel-gateway.conf 5 gateway)
        iwheel_man(iwheel-northbound 7 gateway)
        iwheel_man(iwheelctl 1 tools)
        iwheel_man(iwheel-sim 1 tools)
        iwheel_man(libiwheel-client 3 client-dev)
        if(TARGET iwheel-ros2)
            iwheel_man(iwheel-ros2 1 ros2)
        endif()
    else()
        message(STATUS "LEFT OUT: the manual pages, because scdoc is missing. Cure: apt-get install scdoc")
    endif()
endif()

if(TARGET iwheel-web)
    install(TARGETS iwheel-web RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT web)
    install(DIRECTORY $<TARGET_PROPERTY:iwheel-web,BINARY_DIR>/page/ DESTINATION ${CMAKE_INSTALL_DATADIR}/iwheel-web COMPONENT web)
    install(FILES share/web.conf DESTINATION ${CMAKE_INSTALL_SYSCONFDIR}/iwheel COMPONENT web)
    install(FILES share/sysusers.d/iwheel-web.conf DESTINATION lib/sysusers.d COMPONENT web)
    install(FILES share/systemd/iwheel-web.service DESTINATION ${IWHEEL_SYSTEMD_DIR} COMPONENT web)
    install(FILES share/web/drive.conf share/web/grafana-dashboard.json share/web/prometheus-rules.yml
        DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/iwheel-web/examples COMPONENT web)
    if(IWHEEL_SCDOC)
        iwheel_man(iwheel-web 1 web)
    endif()
endif()
