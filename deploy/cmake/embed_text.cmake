# cmake -DINPUT=file -DOUTPUT=file.cpp -DNAMESPACE=a::b -DNAME=kText -P embed_text.cmake: a text file as `const char* const NAMESPACE::NAME`.
file(READ ${INPUT} text)
file(WRITE ${OUTPUT} "namespace ${NAMESPACE} {
extern const char* const ${NAME};
const char* const ${NAME} = R\"carillon(${text})carillon\";
}  // namespace ${NAMESPACE}
")
