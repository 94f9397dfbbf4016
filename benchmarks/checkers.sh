#!/bin/sh
# Build the checkers that compatibility.py runs: sh benchmarks/checkers.sh FOLDER, then PATH=FOLDER:$PATH.
# On Debian: apt-get install git gcc g++ cmake default-jdk-headless libminizip-dev libxml2-dev
set -eu

mkdir -p "$1/sources/classes"
cd "$1/sources"

checkout() {
    test -d "${1##*/}" || git clone -q "https://github.com/$1"
    git -C "${1##*/}" checkout -q "$2"
}

# VDMCheck, with the VDMJ that it names; the newest lacks the class that its scripts start.
checkout INTO-CPS-Association/FMI-VDM-Model f965d32
checkout nickbattle/vdmj 4.5.0-release
find vdmj/vdmj/src/main vdmj/annotations/src/main FMI-VDM-Model/xsd2vdm FMI-VDM-Model/fmuReader \
    -name '*.java' > classes.txt
javac -nowarn -encoding UTF-8 -d classes @classes.txt
jar cf ../vdmj.jar -C classes . -C vdmj/vdmj/src/main/resources .
jar cf ../annotations.jar -C vdmj/annotations/src/main/resources . \
    -C FMI-VDM-Model/fmuReader/src/main/resources .
for fmi in 2 3; do
    cp "FMI-VDM-Model/fmi$fmi/vdmcheck/src/main/scripts/VDMCheck$fmi.sh" ..
    cp -rT "FMI-VDM-Model/fmi$fmi/vdmcheck/src/main/resources/fmi${fmi}schema" "../fmi${fmi}schema"
    cp -rT "FMI-VDM-Model/fmi$fmi/rule-model" "../fmi$fmi-rule-model"
done

# fmuCheck. Its own build would take an older FMI Library.
checkout modelica-tools/FMUComplianceChecker c704b98
checkout modelon-community/fmi-library 1599ab1
cmake -S fmi-library -B build -DCMAKE_INSTALL_PREFIX=library \
    -DFMILIB_GENERATE_DOXYGEN_DOC=OFF -DFMILIB_BUILD_TESTS=OFF -DFMILIB_BUILD_SHARED_LIB=OFF
cmake --build build --target install
printf '#define %s "%s"\n' FMUCHK_VERSION c704b98 FMIL_VERSION 1599ab1 FMI_PLATFORM linux64 \
    > library/include/fmu_checker_version.h
gcc -O2 -w -o ../fmuCheck.linux64 -IFMUComplianceChecker/include -IFMUComplianceChecker/include/Common \
    -Ilibrary/include FMUComplianceChecker/src/*/*.c -Llibrary/lib -lfmilib -ldl -lm

# fmusim, without CVode, which co-simulation does not use.
checkout modelica/Reference-FMUs v0.0.39
cd Reference-FMUs
# shellcheck disable=SC2046
gcc -O2 -w -o ../../fmusim -no-pie -DFMUSIM_VERSION='"0.0.39"' \
    -Iinclude -Ifmusim -I/usr/include/libxml2 -I/usr/include/minizip \
    $(printf -- '-Wl,--defsym=FMICVode%s=0 ' Create Free Step Reset) \
    $(find fmusim -name '*.c' ! -name FMICVode.c) src/FMI.c src/FMI?.c src/structured_variable_name.*.c \
    -lxml2 -lminizip -lz -ldl -lm
