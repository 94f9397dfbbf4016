/* Has preflight.py find out whether PythonFMU can make an instance: it would end the process. */
enum { FILE_INPUT = 257 };

extern const char source[] __attribute__((visibility("hidden")));
__asm__(".pushsection .rodata\n"
        "source: .incbin \"preflight.py\"\n"
        ".byte 0\n"
        ".popsection\n");

/* A function of preflight.py; NULL with an exception set. */
static void *function(string name) {
    static void *namespace;
    if (namespace == NULL) {
        void *fresh = py.PyDict_New();
        void *done =
            fresh == NULL ? NULL : py.PyRun_StringFlags(source, FILE_INPUT, fresh, fresh, NULL);
        if (done == NULL) {
            py.Py_DecRef(fresh);
            return NULL;
        }
        py.Py_DecRef(done);
        namespace = fresh;
    }
    return py.PyDict_GetItemString(namespace, name);
}

static int preflight(string resources, string guid, message *why) {
    void *refusal = function("refusal");
    void *words = refusal == NULL
                      ? NULL
                      : py.PyObject_CallFunction(refusal, "ss", resources, guid != NULL ? guid : "");
    string text = words == NULL ? NULL : py.PyUnicode_AsUTF8(words);
    int good = text != NULL && text[0] == '\0';
    if (text != NULL && !good) {
        compose(why, "%s", text);
    } else if (text == NULL && !take_exception(why)) {
        compose(why, "the loader is broken");
    }
    py.Py_DecRef(words);
    return good;
}

/* Takes a resources folder off sys.path, where PythonFMU leaves it. */
static void forget(string resources) {
    message unused;
    void *forget = function("forget");
    if (forget != NULL) py.Py_DecRef(py.PyObject_CallFunction(forget, "s", resources));
    take_exception(&unused);
}
